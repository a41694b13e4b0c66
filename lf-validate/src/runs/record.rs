//! Records of runs: one flat object of keys and values a run; which of them are used, and which lack a key.

use super::values::{is_same, plain};
use lf_core::Refusal;
use serde_json::{Map, Value};
use std::fmt;

/// One run. Keys of nested objects are joined with dots; keys keep the order in which they were written.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunRecord {
    /// Source for messages: the file, and the number of the object in it.
    pub(super) source: String,
    /// Values by key: numbers, booleans, texts, null and lists of numbers.
    pub(super) values: Map<String, Value>,
}

impl RunRecord {
    /// The record of an object. Lists that hold anything but numbers and null are left out. Refuses a key that joining
    /// makes twice.
    pub(super) fn of(object: &Map<String, Value>, source: &str) -> Result<Self, Refusal> {
        let mut record = Self { source: source.to_owned(), values: Map::new() };
        record.add("", object)?;
        Ok(record)
    }

    /// Adds the entries of an object, with `prefix` before their keys.
    fn add(&mut self, prefix: &str, object: &Map<String, Value>) -> Result<(), Refusal> {
        for (key, value) in object {
            let key = format!("{prefix}{key}");
            match value {
                Value::Object(inner) => self.add(&format!("{key}."), inner)?,
                Value::Array(list) if !list.iter().all(|value| value.is_number() || value.is_null()) => {}
                _ if self.values.contains_key(&key) => {
                    return Err(Refusal::new(format!("the key {key} twice"), "wanted every key once"));
                }
                _ => {
                    self.values.insert(key, value.clone());
                }
            }
        }
        Ok(())
    }

    /// The value of a key. None if it is missing or null.
    pub(super) fn get(&self, key: &str) -> Option<&Value> {
        self.values.get(key).filter(|value| !value.is_null())
    }

    pub(super) fn number(&self, key: &str) -> Option<f64> {
        self.get(key)?.as_f64()
    }

    /// The list of numbers of a key, with NaN for null.
    pub(super) fn list(&self, key: &str) -> Option<Vec<f64>> {
        let list = self.get(key)?.as_array()?;
        Some(list.iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect())
    }
}

/// Reads JSON objects, one after another, with or without line breaks in them. `name` is the name of the file. Refuses
/// other values.
pub fn read_records(text: &str, name: &str) -> Result<Vec<RunRecord>, Refusal> {
    const WANTED: &str = "wanted JSON objects, one a line";
    let mut records = Vec::new();
    for value in serde_json::Deserializer::from_str(text).into_iter::<Value>() {
        let number = records.len() + 1;
        let value = value.map_err(|error| Refusal::new(format!("object {number} is not JSON ({error})"), WANTED))?;
        let Value::Object(object) = value else {
            return Err(Refusal::new(format!("value {number} is not an object"), WANTED));
        };
        let record = RunRecord::of(&object, &format!("{name}, object {number}"));
        records.push(record.map_err(|r| Refusal::new(format!("object {number} has {}", r.found), r.wanted))?);
    }
    Ok(records)
}

/// A key of a record and the value that it must have: `KEY=VALUE`.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// The key.
    pub key: String,
    /// Its value.
    pub value: Value,
}

impl Condition {
    fn holds(&self, record: &RunRecord) -> bool {
        record.get(&self.key).is_some_and(|value| is_same(value, &self.value))
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "{}={}", self.key, plain(&self.value))
    }
}

/// The records that meet all conditions. Refuses to return none.
pub fn select(records: Vec<RunRecord>, conditions: &[Condition]) -> Result<Vec<RunRecord>, Refusal> {
    if records.is_empty() {
        return Err(Refusal::new("no run", "wanted JSON objects, one a line"));
    }
    let count = records.len();
    let meets = |record: &RunRecord| conditions.iter().all(|condition| condition.holds(record));
    let selected: Vec<RunRecord> = records.into_iter().filter(meets).collect();
    if selected.is_empty() {
        let conditions: Vec<String> = conditions.iter().map(Condition::to_string).collect();
        return Err(Refusal::new(format!("none of {count} runs has {}", conditions.join(" and ")), "wanted one"));
    }
    Ok(selected)
}

/// Most keys that a refusal lists.
const MOST_KEYS: usize = 8;

/// Number of runs that lack a key, for each key.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MissingKeys(Vec<(String, usize)>);

impl MissingKeys {
    pub fn count(&mut self, key: &str) {
        match self.0.iter_mut().find(|(known, _)| known == key) {
            Some((_, count)) => *count += 1,
            None => self.0.push((key.to_owned(), 1)),
        }
    }

    /// A warning in one line: "3 of 10 runs left out, without rms_w_px". None if no run lacks a key.
    pub fn warning(&self, runs: usize) -> Option<String> {
        let parts: Vec<String> =
            self.0.iter().map(|(key, count)| format!("{count} of {runs} runs left out, without {key}")).collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    /// The refusal if no run is left: the keys that the runs lack and those that they have.
    pub fn refusal(&self, records: &[RunRecord]) -> Refusal {
        let mut keys: Vec<&str> = records.iter().flat_map(|record| record.values.keys().map(String::as_str)).collect();
        keys.sort_unstable();
        keys.dedup();
        let (shown, more) = keys.split_at(keys.len().min(MOST_KEYS));
        let more = if more.is_empty() { String::new() } else { format!(" and {} more", more.len()) };
        let found = format!("{} runs, and none can be used; their keys are {}{more}", records.len(), shown.join(", "));
        let wanted: Vec<&str> = self.0.iter().map(|(key, _)| key.as_str()).collect();
        Refusal::new(found, format!("wanted numbers at {}", wanted.join(" and ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn objects_on_one_line_or_on_many_are_records() {
        let text = "{\"a\": 1, \"counts\": {\"kept\": 2, \"x\": {\"y\": true}}}\n{\n \"list\": [1, null],\n \"words\": [\"a\"]}\n";
        let records = read_records(text, "runs").unwrap();
        assert_eq!(Value::Object(records[0].values.clone()), json!({"a": 1, "counts.kept": 2, "counts.x.y": true}));
        assert_eq!(records[1].values.keys().collect::<Vec<_>>(), ["list"]);
        assert!(records[1].list("list").unwrap()[1].is_nan());
        assert_eq!(records[1].source, "runs, object 2");
    }

    #[test]
    fn an_invalid_record_is_refused() {
        for (text, found) in [
            ("{\"a\": 1}\n[1]", "value 2 is not an object"),
            ("{\"a\": ", "object 1 is not JSON"),
            ("{\"a.b\": 1, \"a\": {\"b\": 2}}", "the key a.b twice"),
        ] {
            assert!(read_records(text, "runs").unwrap_err().found.contains(found), "{text}");
        }
    }
}
