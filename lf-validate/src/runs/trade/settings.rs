//! What a setting costs against what it gives.

use super::pareto::{Pareto, pareto};
use crate::runs::record::{Middle, Missing, Record, Refusal, order, plain, same};
use serde::{Serialize, Serializer};
use serde_json::{Map, Value, json};

/// What keys of settings start with.
const SETTING: &str = "set.";
/// The setting that runs of one name may differ in.
const SEED: &str = "set.seed";

/// Which keys are judged.
#[derive(Debug, Clone)]
pub struct Ask {
    /// Key of a setting's name.
    pub name: String,
    /// Key of the cost.
    pub cost: String,
    /// Key of the error.
    pub error: String,
    /// Key of the memory.
    pub memory: String,
    /// The setting that others are compared with.
    pub base: Option<String>,
}

/// Settings, the front among them, and the factors' own effects.
#[derive(Debug, Clone)]
pub struct Trade {
    /// What was asked.
    pub ask: Ask,
    /// Runs that were read and asked for.
    pub runs: usize,
    /// By rising cost.
    pub settings: Vec<Setting>,
    /// Indices of the settings on the Pareto front, by rising cost.
    pub front: Vec<usize>,
    /// Settings that differ from the base in one key.
    pub factors: Vec<Factor>,
    /// Indices of settings that differ from the base in more, or in none.
    pub ungrouped: Vec<usize>,
    /// Runs that lack a key.
    pub missing: Missing,
}

/// The runs of one name.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Its name.
    pub name: String,
    /// Cost over its runs.
    pub cost: Middle,
    /// Error over its runs.
    pub error: Middle,
    /// Memory over those of its runs that tell it.
    pub memory: Middle,
    /// Keys `set.*` without that prefix, and their values, by alphabet.
    pub set: Vec<(String, Value)>,
    /// Index of the setting on the front that has at most its cost and the least error, unless it is on the front.
    pub dominated_by: Option<usize>,
}

/// A key in which some settings differ from the base, and in nothing else.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// The key without `set.`.
    pub key: String,
    /// Its value in the base, null where the base lacks it.
    pub base: Value,
    /// By value.
    pub effects: Vec<Effect>,
}

/// A setting relative to the base.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// Index of the setting.
    pub setting: usize,
    /// The factor's value.
    pub value: Value,
    /// Cost over the base's.
    pub cost_ratio: f64,
    /// Error over the base's.
    pub error_ratio: f64,
    /// Memory over the base's.
    pub memory_ratio: f64,
}

/// The settings of `records`.
///
/// # Errors
/// What was found and what was wanted: no run with name, cost and error; runs of one name that differ in a setting other
/// than the seed; a base that is none of the settings.
pub fn trade(records: &[Record], ask: &Ask) -> Result<Trade, Refusal> {
    let mut missing = Missing::default();
    let mut groups: Vec<(String, Vec<&Record>)> = Vec::new();
    for record in records {
        let lacks = [&ask.cost, &ask.error].into_iter().find(|key| record.number(key).is_none());
        let (Some(name), None) = (record.get(&ask.name), lacks) else {
            missing.count(lacks.unwrap_or(&ask.name));
            continue;
        };
        let name = plain(name);
        match groups.iter_mut().find(|(known, _)| *known == name) {
            Some((_, runs)) => runs.push(record),
            None => groups.push((name, vec![record])),
        }
    }
    if groups.is_empty() {
        return Err(missing.refusal(records));
    }
    let mut settings =
        groups.into_iter().map(|(name, runs)| Setting::of(name, &runs, ask)).collect::<Result<Vec<_>, Refusal>>()?;
    settings.sort_by(|a, b| {
        let by_cost = a.cost.median.total_cmp(&b.cost.median);
        by_cost.then(a.error.median.total_cmp(&b.error.median)).then(a.name.cmp(&b.name))
    });
    let points: Vec<[f64; 2]> = settings.iter().map(|setting| [setting.cost.median, setting.error.median]).collect();
    let Pareto { front, dominated_by } = pareto(&points);
    for (setting, by) in settings.iter_mut().zip(dominated_by) {
        setting.dominated_by = by;
    }
    let mut trade = Trade {
        ask: ask.clone(),
        runs: records.len(),
        settings,
        front,
        factors: Vec::new(),
        ungrouped: Vec::new(),
        missing,
    };
    trade.compare()?;
    Ok(trade)
}

impl Setting {
    fn of(name: String, runs: &[&Record], ask: &Ask) -> Result<Self, Refusal> {
        let is_setting = |key: &str| key.starts_with(SETTING) && key != SEED;
        let mut keys: Vec<&String> = runs.iter().flat_map(|run| run.values.keys()).collect();
        keys.retain(|key| is_setting(key));
        keys.sort_unstable();
        keys.dedup();
        let mut set = Vec::new();
        for key in keys {
            let value = |run: &Record| run.get(key).cloned().unwrap_or_default();
            let first = value(runs[0]);
            if let Some(other) = runs.iter().find(|run| !same(&value(run), &first)) {
                let [one, two] = [&first, &value(other)].map(plain);
                let found =
                    format!("{key} is {one} in {} and {two} in {}, both named {name}", runs[0].place, other.place);
                return Err((found, format!("wanted runs of one name that differ in {SEED} only")));
            }
            set.push((key[SETTING.len()..].to_owned(), first));
        }
        let middle = |key: &str| Middle::of(runs.iter().filter_map(|run| run.number(key)));
        let [cost, error, memory] = [&ask.cost, &ask.error, &ask.memory].map(|key| middle(key));
        Ok(Self { name, cost, error, memory, set, dominated_by: None })
    }

    fn value(&self, key: &str) -> Value {
        self.set.iter().find(|(known, _)| known == key).map(|(_, value)| value.clone()).unwrap_or_default()
    }
}

impl Trade {
    /// Index of the base.
    pub fn base(&self) -> Option<usize> {
        self.settings.iter().position(|setting| Some(&setting.name) == self.ask.base.as_ref())
    }

    /// Names of the settings with at most this cost and this error, by rising cost.
    pub fn within(&self, max_cost: Option<f64>, max_error: Option<f64>) -> Vec<&str> {
        let keeps = |value: f64, limit: Option<f64>| limit.is_none_or(|limit| value <= limit);
        let within = self
            .settings
            .iter()
            .filter(|setting| keeps(setting.cost.median, max_cost) && keeps(setting.error.median, max_error));
        within.map(|setting| setting.name.as_str()).collect()
    }

    /// Groups what differs from the base in one key.
    fn compare(&mut self) -> Result<(), Refusal> {
        let Some(name) = &self.ask.base else { return Ok(()) };
        let Some(base) = self.base() else {
            let names: Vec<&str> = self.settings.iter().map(|setting| setting.name.as_str()).collect();
            return Err((format!("no setting is named {name}"), format!("wanted one of {}", names.join(", "))));
        };
        let base = &self.settings[base];
        for (n, setting) in self.settings.iter().enumerate().filter(|(_, setting)| setting.name != base.name) {
            let mut keys: Vec<&String> = setting.set.iter().chain(&base.set).map(|(key, _)| key).collect();
            keys.sort_unstable();
            keys.dedup();
            keys.retain(|key| !same(&setting.value(key), &base.value(key)));
            let [key] = keys[..] else {
                self.ungrouped.push(n);
                continue;
            };
            let effect = Effect {
                setting: n,
                value: setting.value(key),
                cost_ratio: setting.cost.median / base.cost.median,
                error_ratio: setting.error.median / base.error.median,
                memory_ratio: setting.memory.median / base.memory.median,
            };
            match self.factors.iter_mut().find(|factor| factor.key == *key) {
                Some(factor) => factor.effects.push(effect),
                None => {
                    self.factors.push(Factor { key: key.clone(), base: base.value(key), effects: vec![effect] });
                }
            }
        }
        self.factors.sort_by(|a, b| a.key.cmp(&b.key));
        for factor in &mut self.factors {
            factor.effects.sort_by(|a, b| order(&a.value, &b.value));
        }
        Ok(())
    }

    fn name(&self, setting: usize) -> &str {
        &self.settings[setting].name
    }
}

impl Serialize for Trade {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.report().serialize(serializer)
    }
}

impl Trade {
    fn report(&self) -> Value {
        let Ask { name, cost, error, memory, base } = &self.ask;
        let front = self.front.iter().map(|n| {
            let Setting { name, cost, error, memory, .. } = &self.settings[*n];
            (name.clone(), json!({"cost": cost.median, "error": error.median, "memory": memory.median}))
        });
        let settings = self.settings.iter().map(|setting| (setting.name.clone(), self.whole(setting)));
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
            let factors = self.factors.iter().map(|factor| (factor.key.clone(), self.effects(factor)));
            report["factors"] = factors.collect::<Map<_, _>>().into();
            report["ungrouped"] = self.ungrouped.iter().map(|n| self.name(*n)).collect();
        }
        report
    }

    fn whole(&self, setting: &Setting) -> Value {
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

    fn effects(&self, factor: &Factor) -> Value {
        let effects = factor.effects.iter().map(|effect| {
            let Effect { setting, value, cost_ratio, error_ratio, memory_ratio } = effect;
            let ratios = json!({
                "value": value, "cost_ratio": cost_ratio, "error_ratio": error_ratio, "memory_ratio": memory_ratio,
            });
            (self.name(*setting).to_owned(), ratios)
        });
        json!({"base": factor.base, "settings": effects.collect::<Map<_, _>>()})
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runs::record::records;

    const RUNS: &str = r#"
        {"name": "base", "set.n": 60, "set.seed": 1, "set.kernel": "drt", "s": 10, "e": 0.4, "m": 100}
        {"name": "base", "set.n": 60, "set.seed": 2, "set.kernel": "drt", "s": 30, "e": 0.6}
        {"name": "short", "set.n": 20, "set.kernel": "drt", "s": 5, "e": 1.0, "m": 50}
        {"name": "long", "set.n": 120, "set.kernel": "drt", "s": 40, "e": 0.5}
        {"name": "exact", "set.n": 60, "set.kernel": "exact", "s": 200, "e": 0.1}
        {"name": "both", "set.n": 20, "set.kernel": "exact", "s": 70, "e": null}
        {"name": "other", "set.n": 20, "set.kernel": "exact", "s": 70, "e": 3}"#;

    fn ask(base: Option<&str>) -> Ask {
        let [name, cost, error, memory] = ["name", "s", "e", "m"].map(str::to_owned);
        Ask { name, cost, error, memory, base: base.map(str::to_owned) }
    }

    #[test]
    fn seeds_become_settings_and_settings_a_front() {
        let trade = trade(&records(RUNS, "runs").unwrap(), &ask(None)).unwrap();
        let report = trade.report();
        assert_eq!(report["front"].as_object().unwrap().keys().collect::<Vec<_>>(), ["short", "base", "exact"]);
        let base = &report["settings"]["base"];
        assert_eq!(base["cost_range"], json!([10.0, 30.0]));
        assert_eq!((&base["cost"], &base["error"], &base["memory"]), (&json!(20.0), &json!(0.5), &json!(100.0)));
        assert_eq!((&base["set"], &base["dominated_by"]), (&json!({"kernel": "drt", "n": 60}), &Value::Null));
        assert_eq!(report["settings"]["long"]["dominated_by"], "base");
        assert_eq!(report["settings"]["long"]["memory"], Value::Null);
        assert_eq!(trade.missing.line(trade.runs).unwrap(), "1 of 7 runs left out for want of e");
        assert_eq!(trade.within(Some(40.0), Some(0.5)), ["base", "long"]);
        assert!(trade.within(Some(19.0), Some(0.5)).is_empty());
    }

    #[test]
    fn one_factor_at_a_time() {
        let report = trade(&records(RUNS, "runs").unwrap(), &ask(Some("base"))).unwrap().report();
        let n = &report["factors"]["n"];
        assert_eq!((&n["base"], &n["settings"]["short"]["value"]), (&json!(60), &json!(20)));
        assert_eq!(n["settings"].as_object().unwrap().keys().collect::<Vec<_>>(), ["short", "long"]);
        assert_eq!(n["settings"]["short"]["cost_ratio"], 0.25);
        assert_eq!(n["settings"]["short"]["error_ratio"], 2.0);
        assert_eq!(report["factors"]["kernel"]["settings"]["exact"]["cost_ratio"], 10.0);
        assert_eq!(report["ungrouped"], json!(["other"]));
    }

    #[test]
    fn runs_that_make_no_sense_are_refused() {
        let refused = |text: &str, base| trade(&records(text, "runs").unwrap(), &ask(base)).unwrap_err().0;
        assert!(refused(RUNS, Some("none")).contains("no setting is named none"));
        let text = r#"{"name": "a", "set.n": 1, "s": 1, "e": 1} {"name": "a", "set.n": 2, "s": 1, "e": 1}"#;
        assert!(refused(text, None).contains("set.n is 1 in runs, object 1 and 2 in runs, object 2"));
        assert!(refused(r#"{"name": "a", "s": 1}"#, None).contains("their keys are name, s"));
    }
}
