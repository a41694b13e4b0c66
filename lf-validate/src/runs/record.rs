//! Records of runs: one flat object of keys and values a run.

use lf_core::Refusal;
use serde_json::{Map, Value};

/// One run. Keys of nested objects are joined with dots; keys keep the order in which they were written.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunRecord {
    /// Source for messages: the file, and the number of the object in it.
    pub source: String,
    /// Values by key: numbers, booleans, texts, null and lists of numbers.
    pub values: Map<String, Value>,
}

impl RunRecord {
    /// The record of an object. Lists that hold anything but numbers and null are left out.
    ///
    /// # Errors
    /// Two keys are the same after joining.
    pub fn of(object: &Map<String, Value>, source: &str) -> Result<Self, Refusal> {
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
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.values.get(key).filter(|value| !value.is_null())
    }

    /// The number of a key. None if it is missing or not a number.
    pub fn number(&self, key: &str) -> Option<f64> {
        self.get(key)?.as_f64()
    }

    /// The list of numbers of a key, with NaN for null. None if it is missing or not a list.
    pub fn list(&self, key: &str) -> Option<Vec<f64>> {
        let list = self.get(key)?.as_array()?;
        Some(list.iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect())
    }
}

/// Reads JSON objects, one after another, with or without line breaks in them. `name` is the name of the file.
///
/// # Errors
/// The text is not JSON, or a value is not an object.
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
