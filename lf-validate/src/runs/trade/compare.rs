//! Cost and error of each setting, and the effect of each factor.

use super::pareto::{Pareto, pareto};
use super::settings::{Effect, Factor, Setting, Trade, TradeKeys};
use crate::runs::record::{MissingKeys, RunRecord};
use crate::runs::values::{MedianRange, is_same, order, plain};
use lf_core::Refusal;

/// Prefix of the keys of settings, and the key in which runs of one name may differ.
const SETTING: &str = "set.";
const SEED: &str = "set.seed";

/// Cost and error of the settings in `records`. Refuses records without a run that has name, cost and error, runs of
/// one name that differ in a key `set.*` other than the seed, and a base that is no setting.
pub fn trade(records: &[RunRecord], keys: &TradeKeys) -> Result<Trade, Refusal> {
    let mut missing = MissingKeys::default();
    let mut groups: Vec<(String, Vec<&RunRecord>)> = Vec::new();
    for record in records {
        let lacks = [&keys.cost, &keys.error].into_iter().find(|key| record.number(key).is_none());
        let (Some(name), None) = (record.get(&keys.name), lacks) else {
            missing.count(lacks.unwrap_or(&keys.name));
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
    let settings = groups.into_iter().map(|(name, runs)| setting(name, &runs, keys));
    let mut settings = settings.collect::<Result<Vec<_>, Refusal>>()?;
    settings.sort_by(|a, b| {
        let by_cost = a.cost.median.total_cmp(&b.cost.median);
        by_cost.then(a.error.median.total_cmp(&b.error.median)).then(a.name.cmp(&b.name))
    });
    let points: Vec<[f64; 2]> = settings.iter().map(|setting| [setting.cost.median, setting.error.median]).collect();
    let Pareto { front, dominated_by } = pareto(&points);
    for (setting, by) in settings.iter_mut().zip(dominated_by) {
        setting.dominated_by = by;
    }
    let (factors, ungrouped) = match &keys.base {
        Some(base) => factors(&settings, base)?,
        None => (Vec::new(), Vec::new()),
    };
    Ok(Trade { keys: keys.clone(), runs: records.len(), settings, front, factors, ungrouped, missing })
}

/// The setting of the runs of one name.
fn setting(name: String, runs: &[&RunRecord], keys: &TradeKeys) -> Result<Setting, Refusal> {
    let is_setting = |key: &&String| key.starts_with(SETTING) && *key != SEED;
    let mut set_keys: Vec<&String> = runs.iter().flat_map(|run| run.values.keys()).filter(is_setting).collect();
    set_keys.sort_unstable();
    set_keys.dedup();
    let mut set = Vec::new();
    for key in set_keys {
        let value = |run: &RunRecord| run.get(key).cloned().unwrap_or_default();
        let first = value(runs[0]);
        if let Some(other) = runs.iter().find(|run| !is_same(&value(run), &first)) {
            let [one, two] = [&first, &value(other)].map(plain);
            let found =
                format!("{key} is {one} in {} and {two} in {}, both named {name}", runs[0].source, other.source);
            return Err(Refusal::new(found, format!("wanted runs of one name that differ in {SEED} only")));
        }
        set.push((key[SETTING.len()..].to_owned(), first));
    }
    let [cost, error, memory] = [&keys.cost, &keys.error, &keys.memory]
        .map(|key| MedianRange::of(runs.iter().filter_map(|run| run.number(key))));
    Ok(Setting { name, cost, error, memory, set, dominated_by: None })
}

/// The settings that differ from the base in one key, by that key, and the indices of all others.
fn factors(settings: &[Setting], base: &str) -> Result<(Vec<Factor>, Vec<usize>), Refusal> {
    let Some(base) = settings.iter().find(|setting| setting.name == base) else {
        let names: Vec<&str> = settings.iter().map(|setting| setting.name.as_str()).collect();
        return Err(Refusal::new(format!("no setting is named {base}"), format!("wanted one of {}", names.join(", "))));
    };
    let (mut factors, mut ungrouped) = (Vec::<Factor>::new(), Vec::new());
    for (n, setting) in settings.iter().enumerate().filter(|(_, setting)| setting.name != base.name) {
        let mut keys: Vec<&String> = setting.set.iter().chain(&base.set).map(|(key, _)| key).collect();
        keys.sort_unstable();
        keys.dedup();
        keys.retain(|key| !is_same(&setting.value(key), &base.value(key)));
        let [key] = keys[..] else {
            ungrouped.push(n);
            continue;
        };
        let effect = Effect {
            setting: n,
            value: setting.value(key),
            cost_ratio: setting.cost.median / base.cost.median,
            error_ratio: setting.error.median / base.error.median,
            memory_ratio: setting.memory.median / base.memory.median,
        };
        match factors.iter_mut().find(|factor| factor.key == *key) {
            Some(factor) => factor.effects.push(effect),
            None => factors.push(Factor { key: key.clone(), base: base.value(key), effects: vec![effect] }),
        }
    }
    factors.sort_by(|a, b| a.key.cmp(&b.key));
    for factor in &mut factors {
        factor.effects.sort_by(|a, b| order(&a.value, &b.value));
    }
    Ok((factors, ungrouped))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runs::record::read_records;
    use serde_json::{Value, json};

    const RUNS: &str = r#"
        {"name": "base", "set.n": 60, "set.seed": 1, "set.kernel": "drt", "s": 10, "e": 0.4, "m": 100}
        {"name": "base", "set.n": 60, "set.seed": 2, "set.kernel": "drt", "s": 30, "e": 0.6}
        {"name": "short", "set.n": 20, "set.kernel": "drt", "s": 5, "e": 1.0, "m": 50}
        {"name": "long", "set.n": 120, "set.kernel": "drt", "s": 40, "e": 0.5}
        {"name": "exact", "set.n": 60, "set.kernel": "exact", "s": 200, "e": 0.1}
        {"name": "both", "set.n": 20, "set.kernel": "exact", "s": 70, "e": null}
        {"name": "other", "set.n": 20, "set.kernel": "exact", "s": 70, "e": 3}"#;

    fn keys(base: Option<&str>) -> TradeKeys {
        let [name, cost, error, memory] = ["name", "s", "e", "m"].map(str::to_owned);
        TradeKeys { name, cost, error, memory, base: base.map(str::to_owned) }
    }

    #[test]
    fn seeds_become_settings_and_settings_a_front() {
        let trade = trade(&read_records(RUNS, "runs").unwrap(), &keys(None)).unwrap();
        let report = trade.report();
        assert_eq!(report["front"].as_object().unwrap().keys().collect::<Vec<_>>(), ["short", "base", "exact"]);
        let base = &report["settings"]["base"];
        assert_eq!(base["cost_range"], json!([10.0, 30.0]));
        assert_eq!((&base["cost"], &base["error"], &base["memory"]), (&json!(20.0), &json!(0.5), &json!(100.0)));
        assert_eq!((&base["set"], &base["dominated_by"]), (&json!({"kernel": "drt", "n": 60}), &Value::Null));
        assert_eq!(report["settings"]["long"]["dominated_by"], "base");
        assert_eq!(report["settings"]["long"]["memory"], Value::Null);
        assert_eq!(trade.missing.warning(trade.runs).unwrap(), "1 of 7 runs left out, without e");
        assert_eq!(trade.within(Some(40.0), Some(0.5)), ["base", "long"]);
        assert!(trade.within(Some(19.0), Some(0.5)).is_empty());
    }

    #[test]
    fn one_factor_at_a_time() {
        let report = trade(&read_records(RUNS, "runs").unwrap(), &keys(Some("base"))).unwrap().report();
        let n = &report["factors"]["n"];
        assert_eq!((&n["base"], &n["settings"]["short"]["value"]), (&json!(60), &json!(20)));
        assert_eq!(n["settings"].as_object().unwrap().keys().collect::<Vec<_>>(), ["short", "long"]);
        assert_eq!(n["settings"]["short"]["cost_ratio"], 0.25);
        assert_eq!(n["settings"]["short"]["error_ratio"], 2.0);
        assert_eq!(report["factors"]["kernel"]["settings"]["exact"]["cost_ratio"], 10.0);
        assert_eq!(report["ungrouped"], json!(["other"]));
    }

    #[test]
    fn runs_that_disagree_or_lack_a_key_are_refused() {
        let refused = |text: &str, base| trade(&read_records(text, "runs").unwrap(), &keys(base)).unwrap_err().found;
        assert!(refused(RUNS, Some("none")).contains("no setting is named none"));
        let text = r#"{"name": "a", "set.n": 1, "s": 1, "e": 1} {"name": "a", "set.n": 2, "s": 1, "e": 1}"#;
        assert!(refused(text, None).contains("set.n is 1 in runs, object 1 and 2 in runs, object 2"));
        assert!(refused(r#"{"name": "a", "s": 1}"#, None).contains("their keys are name, s"));
    }
}
