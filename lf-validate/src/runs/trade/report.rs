//! The JSON of settings, front and factors.

use super::settings::{Effect, Factor, Setting, Trade, TradeKeys};
use serde::{Serialize, Serializer};
use serde_json::{Map, Value, json};

impl Serialize for Trade {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.report().serialize(serializer)
    }
}

impl Trade {
    /// The JSON of `lf-validate trade`.
    pub(super) fn report(&self) -> Value {
        let TradeKeys { name, cost, error, memory, base } = &self.keys;
        let front = self.front.iter().map(|n| {
            let Setting { name, cost, error, memory, .. } = &self.settings[*n];
            (name.clone(), json!({"cost": cost.median, "error": error.median, "memory": memory.median}))
        });
        let settings = self.settings.iter().map(|setting| (setting.name.clone(), self.setting_json(setting)));
        let mut report = json!({
            "name": name,
            "cost": cost,
            "error": error,
            "memory": memory,
            "runs": self.runs,
            "front": front.collect::<Map<_, _>>(),
            "settings": settings.collect::<Map<_, _>>(),
        });
        if base.is_some() {
            report["base"] = json!(base);
            let factors = self.factors.iter().map(|factor| (factor.key.clone(), self.factor_json(factor)));
            report["factors"] = factors.collect::<Map<_, _>>().into();
            report["ungrouped"] = self.ungrouped.iter().map(|n| self.name(*n)).collect();
        }
        report
    }

    fn setting_json(&self, setting: &Setting) -> Value {
        let Setting { cost, error, memory, set, dominated_by, .. } = setting;
        json!({
            "runs": cost.runs,
            "cost": cost.median,
            "cost_range": [cost.low, cost.high],
            "error": error.median,
            "error_range": [error.low, error.high],
            "memory": memory.median,
            "memory_range": [memory.low, memory.high],
            "dominated_by": dominated_by.map(|n| self.name(n)),
            "set": set.iter().cloned().collect::<Map<_, _>>(),
        })
    }

    fn factor_json(&self, factor: &Factor) -> Value {
        let effects = factor.effects.iter().map(|effect| {
            let Effect { setting, value, cost_ratio, error_ratio, memory_ratio } = effect;
            let ratios = json!({
                "value": value, "cost_ratio": cost_ratio, "error_ratio": error_ratio, "memory_ratio": memory_ratio,
            });
            (self.name(*setting).to_owned(), ratios)
        });
        json!({"base": factor.base, "settings": effects.collect::<Map<_, _>>()})
    }

    fn name(&self, setting: usize) -> &str {
        &self.settings[setting].name
    }
}
