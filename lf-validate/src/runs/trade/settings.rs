//! Settings, their front and the effects of factors, and their JSON.

use crate::runs::{record::MissingKeys, values::MedianRange};
use serde::{Serialize, Serializer};
use serde_json::{Map, Value, json};

/// The keys that are compared.
#[derive(Debug, Clone)]
pub struct TradeKeys {
    /// Key of a setting's name.
    pub name: String,
    /// Key of the cost.
    pub cost: String,
    /// Key of the error.
    pub error: String,
    /// Key of the memory.
    pub memory: String,
    /// Name of the setting that others are compared with.
    pub base: Option<String>,
}

/// Cost and error of all settings, the front among them, and the effects of single factors.
#[derive(Debug, Clone)]
pub struct Trade {
    pub(super) keys: TradeKeys,
    /// Runs that were read and selected.
    pub runs: usize,
    /// Settings by rising cost.
    pub settings: Vec<Setting>,
    /// Indices of the settings on the Pareto front, by rising cost.
    pub front: Vec<usize>,
    /// Sorted by key.
    pub(super) factors: Vec<Factor>,
    /// Indices of settings that differ from the base in more than one key, or in none.
    pub(super) ungrouped: Vec<usize>,
    /// Runs that lack a key.
    pub missing: MissingKeys,
}

/// The runs of one name.
#[derive(Debug, Clone)]
pub struct Setting {
    pub name: String,
    pub cost: MedianRange,
    pub error: MedianRange,
    /// Over the runs that have it.
    pub memory: MedianRange,
    /// Keys `set.*` without that prefix, by alphabet, and their values.
    pub set: Vec<(String, Value)>,
    /// Index of the setting on the front that has at most this cost and the least error. None on the front.
    pub dominated_by: Option<usize>,
}

/// A key in which some settings differ from the base, and in nothing else.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// The key without `set.`.
    pub key: String,
    /// Its value in the base. Null if the base lacks it.
    pub base: Value,
    /// Sorted by value.
    pub effects: Vec<Effect>,
}

/// A setting relative to the base.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// Index of the setting.
    pub setting: usize,
    /// Value of the factor.
    pub value: Value,
    pub cost_ratio: f64,
    pub error_ratio: f64,
    pub memory_ratio: f64,
}

impl Setting {
    /// The value of a key `set.*`, without that prefix. Null if the setting lacks it.
    pub(super) fn value(&self, key: &str) -> Value {
        self.set.iter().find(|(known, _)| known == key).map(|(_, value)| value.clone()).unwrap_or_default()
    }
}

impl Trade {
    /// Index of the base.
    pub(super) fn base(&self) -> Option<usize> {
        self.settings.iter().position(|setting| Some(&setting.name) == self.keys.base.as_ref())
    }

    /// Names of the settings with at most this cost and this error, by rising cost.
    pub fn within(&self, max_cost: Option<f64>, max_error: Option<f64>) -> Vec<&str> {
        let keeps = |value: f64, limit: Option<f64>| limit.is_none_or(|limit| value <= limit);
        let is_within =
            |setting: &&Setting| keeps(setting.cost.median, max_cost) && keeps(setting.error.median, max_error);
        self.settings.iter().filter(is_within).map(|setting| setting.name.as_str()).collect()
    }
}

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
            let Effect { setting, value, cost_ratio, error_ratio, memory_ratio: memory } = effect;
            let ratios =
                json!({"value": value, "cost_ratio": cost_ratio, "error_ratio": error_ratio, "memory_ratio": memory});
            (self.name(*setting).to_owned(), ratios)
        });
        json!({"base": factor.base, "settings": effects.collect::<Map<_, _>>()})
    }

    fn name(&self, setting: usize) -> &str {
        &self.settings[setting].name
    }
}
