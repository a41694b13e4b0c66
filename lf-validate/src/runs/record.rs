//! Records of runs: flat objects of keys and values, one a run.

use lf_core::statistics::median;
use serde::Serialize;
use serde_json::{Map, Value};
use std::cmp::Ordering;
use std::fmt;

/// Keys that a refusal lists.
const MOST_KEYS: usize = 8;

/// What was found and what was wanted.
pub type Refusal = (String, String);

/// One run: keys, with dots where objects were nested, in the order they were written.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Record {
    /// File and number of the object in it, for messages.
    pub place: String,
    /// Keys and values: numbers, booleans, texts, null and lists of numbers.
    pub values: Map<String, Value>,
}

impl Record {
    /// The record of an object: nested keys joined with dots, lists of anything but numbers and nulls left out.
    ///
    /// # Errors
    /// A key that is there twice once keys are joined.
    pub fn of(object: &Map<String, Value>, place: &str) -> Result<Self, Refusal> {
        let mut record = Self { place: place.to_owned(), values: Map::new() };
        record.add("", object)?;
        Ok(record)
    }

    fn add(&mut self, before: &str, object: &Map<String, Value>) -> Result<(), Refusal> {
        for (key, value) in object {
            let key = format!("{before}{key}");
            match value {
                Value::Object(inner) => self.add(&format!("{key}."), inner)?,
                Value::Array(list) if !list.iter().all(|value| value.is_number() || value.is_null()) => {}
                _ if self.values.contains_key(&key) => {
                    return Err((format!("the key {key} twice"), "wanted every key once".into()));
                }
                _ => {
                    self.values.insert(key, value.clone());
                }
            }
        }
        Ok(())
    }

    /// A value; none where it is missing or null.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.values.get(key).filter(|value| !value.is_null())
    }

    /// A number.
    pub fn number(&self, key: &str) -> Option<f64> {
        self.get(key)?.as_f64()
    }

    /// A list of numbers, null as NaN.
    pub fn list(&self, key: &str) -> Option<Vec<f64>> {
        let list = self.get(key)?.as_array()?;
        Some(list.iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect())
    }
}

/// The records of a text of JSON objects, one after another, on one line each or on several.
///
/// # Errors
/// What is not JSON, or not an object.
pub fn records(text: &str, name: &str) -> Result<Vec<Record>, Refusal> {
    const WANTED: &str = "wanted JSON objects, one a line";
    let mut records = Vec::new();
    for value in serde_json::Deserializer::from_str(text).into_iter::<Value>() {
        let number = records.len() + 1;
        let value = value.map_err(|error| (format!("object {number} is not JSON ({error})"), WANTED.to_string()))?;
        let Value::Object(object) = value else {
            return Err((format!("value {number} is no object"), WANTED.into()));
        };
        let record = Record::of(&object, &format!("{name}, object {number}"));
        records.push(record.map_err(|(found, wanted)| (format!("object {number} has {found}"), wanted))?);
    }
    Ok(records)
}

/// A word as a number, `true` or `false`, or else as text.
pub fn typed(word: &str) -> Value {
    match word {
        "true" => Value::Bool(true),
        "false" => Value::Bool(false),
        _ => {
            let whole = word.parse::<i64>().map(Value::from).ok();
            let number = || word.parse::<f64>().ok().filter(|number| number.is_finite()).map(Value::from);
            whole.or_else(number).unwrap_or_else(|| Value::from(word))
        }
    }
}

/// Whether two values are one: 1 is 1.0.
pub fn same(one: &Value, other: &Value) -> bool {
    order(one, other) == Ordering::Equal
}

/// Numbers by size, then booleans, then texts by alphabet, then all else, null last.
pub fn order(one: &Value, other: &Value) -> Ordering {
    let rank = |value: &Value| match value {
        Value::Number(_) => 0,
        Value::Bool(_) => 1,
        Value::String(_) => 2,
        Value::Null => 4,
        _ => 3,
    };
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => {
            let [one, other] = [one, other].map(|number| number.as_f64().unwrap_or(f64::NAN) + 0.0);
            one.total_cmp(&other)
        }
        (Value::Bool(one), Value::Bool(other)) => one.cmp(other),
        (Value::String(one), Value::String(other)) => one.cmp(other),
        (Value::Array(_), Value::Array(_)) => one.to_string().cmp(&other.to_string()),
        _ => rank(one).cmp(&rank(other)),
    }
}

/// A value as a person writes it.
pub fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "none".into(),
        _ => value.to_string(),
    }
}

/// A key of a record and what it has to be: `key=value`.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// The key.
    pub key: String,
    /// Its value.
    pub value: Value,
}

impl Condition {
    /// Whether a record meets it.
    pub fn holds(&self, record: &Record) -> bool {
        record.get(&self.key).is_some_and(|value| same(value, &self.value))
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "{}={}", self.key, plain(&self.value))
    }
}

/// The records that meet every condition.
///
/// # Errors
/// Where there is none: the conditions, or no record at all.
pub fn chosen(records: Vec<Record>, conditions: &[Condition]) -> Result<Vec<Record>, Refusal> {
    if records.is_empty() {
        return Err(("no run".into(), "wanted JSON objects, one a line".into()));
    }
    let count = records.len();
    let chosen: Vec<Record> =
        records.into_iter().filter(|record| conditions.iter().all(|condition| condition.holds(record))).collect();
    if chosen.is_empty() {
        let conditions: Vec<String> = conditions.iter().map(Condition::to_string).collect();
        return Err((format!("none of {count} runs has {}", conditions.join(" and ")), "wanted one".into()));
    }
    Ok(chosen)
}

/// Runs that could not be used, by the keys that they lack.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Missing(Vec<(String, usize)>);

impl Missing {
    /// Counts a run that lacks `key`.
    pub fn count(&mut self, key: &str) {
        match self.0.iter_mut().find(|(known, _)| known == key) {
            Some((_, count)) => *count += 1,
            None => self.0.push((key.to_owned(), 1)),
        }
    }

    /// One line, none where no run lacks anything: "3 of 10 runs lack rms_w_px".
    pub fn line(&self, runs: usize) -> Option<String> {
        let parts: Vec<String> =
            self.0.iter().map(|(key, count)| format!("{count} of {runs} runs left out for want of {key}")).collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    /// The refusal where no run is left: what they lack and which keys they have.
    pub fn refusal(&self, records: &[Record]) -> Refusal {
        let mut keys: Vec<&str> = records.iter().flat_map(|record| record.values.keys().map(String::as_str)).collect();
        keys.sort_unstable();
        keys.dedup();
        let wanted: Vec<&str> = self.0.iter().map(|(key, _)| key.as_str()).collect();
        let wanted = format!("wanted numbers at {}", wanted.join(" and "));
        let (shown, more) = keys.split_at(keys.len().min(MOST_KEYS));
        let more = if more.is_empty() { String::new() } else { format!(" and {} more", more.len()) };
        let keys = shown.join(", ");
        (format!("{} runs, none that can be used; their keys are {keys}{more}", records.len()), wanted)
    }
}

/// The middle and the ends of some numbers; NaN, `null` in JSON, of none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Middle {
    /// Median.
    pub median: f64,
    /// Least.
    pub low: f64,
    /// Greatest.
    pub high: f64,
    /// How many.
    pub runs: usize,
}

impl Middle {
    /// Of the finite ones of `values`.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
        let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max]
            .map(|pick| values.iter().copied().reduce(pick).unwrap_or(f64::NAN));
        Self { low, high, runs: values.len(), median: median(&mut values) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn lines_and_spread_out_objects_are_records() {
        let text = "{\"a\": 1, \"counts\": {\"kept\": 2, \"x\": {\"y\": true}}}\n{\n \"list\": [1, null],\n \"words\": [\"a\"]}\n";
        let records = records(text, "runs").unwrap();
        assert_eq!(Value::Object(records[0].values.clone()), json!({"a": 1, "counts.kept": 2, "counts.x.y": true}));
        assert_eq!(records[1].values.keys().collect::<Vec<_>>(), ["list"]);
        assert!(records[1].list("list").unwrap()[1].is_nan());
        assert_eq!(records[1].place, "runs, object 2");
    }

    #[test]
    fn what_is_no_record_is_refused() {
        for (text, found) in [
            ("{\"a\": 1}\n[1]", "value 2 is no object"),
            ("{\"a\": ", "object 1 is not JSON"),
            ("{\"a.b\": 1, \"a\": {\"b\": 2}}", "the key a.b twice"),
        ] {
            assert!(records(text, "runs").unwrap_err().0.contains(found), "{text}");
        }
    }

    #[test]
    fn words_have_types() {
        for (word, value) in [
            ("60", json!(60)),
            ("-0.5", json!(-0.5)),
            ("1e3", json!(1000.0)),
            ("true", json!(true)),
            ("drt", json!("drt")),
            ("inf", json!("inf")),
            ("", json!("")),
        ] {
            assert_eq!(typed(word), value);
        }
    }

    #[test]
    fn values_are_in_order() {
        let mut values = vec![json!("b"), json!(10), json!(null), json!(2.5), json!(true), json!("a"), json!(-1)];
        values.sort_by(order);
        assert_eq!(json!(values), json!([-1, 2.5, 10, true, "a", "b", null]));
        assert!(same(&json!(1), &json!(1.0)) && !same(&json!("1"), &json!(1)));
    }

    #[test]
    fn the_middle_of_what_is_finite() {
        assert_eq!(Middle::of([3.0, f64::NAN, 1.0]), Middle { median: 2.0, low: 1.0, high: 3.0, runs: 2 });
        assert!(Middle::of([]).low.is_nan());
    }
}
