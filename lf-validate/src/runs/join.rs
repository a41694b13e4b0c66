//! One record of a run, joined from settings and from the JSON that tools wrote about it.

use super::record::RunRecord;
use super::values::{parse_value, plain};
use lf_core::Refusal;
use serde_json::{Map, Value};

/// An argument of `lf-validate line`.
#[derive(Debug, Clone, PartialEq)]
pub enum Argument<'a> {
    /// `KEY=VALUE`.
    Setting(&'a str, Value),
    /// `FILE` or `NAME:FILE`: the name, empty without one, and the file.
    File(&'a str, &'a str),
}

impl<'a> Argument<'a> {
    /// The first of `=`, `:` and `/` decides between a setting, a named file and a file. Refuses an empty key, name or
    /// file.
    pub fn parse(word: &'a str) -> Result<Self, Refusal> {
        let cut = word.find(['=', ':', '/']).map(|at| (&word[..at], &word[at..at + 1], &word[at + 1..]));
        let (parsed, is_whole) = match cut {
            Some((key, "=", value)) => (Self::Setting(key, parse_value(value)), !key.is_empty()),
            Some((name, ":", file)) => (Self::File(name, file), !name.is_empty() && !file.is_empty()),
            _ => (Self::File("", word), !word.is_empty()),
        };
        let refusal = || Refusal::new(format!("'{word}'"), "wanted KEY=VALUE, FILE or NAME:FILE");
        is_whole.then_some(parsed).ok_or_else(refusal)
    }
}

/// Entries of a record that come from one source.
pub struct Entries {
    /// Source for messages: the name of the file, or the setting as it was typed.
    source: String,
    /// Prefix of every key.
    prefix: String,
    values: Map<String, Value>,
}

impl Entries {
    /// One setting.
    pub fn setting(key: &str, value: Value) -> Self {
        let source = format!("{key}={}", plain(&value));
        Self { source, prefix: String::new(), values: Map::from_iter([(key.to_owned(), value)]) }
    }

    /// The JSON object that a tool wrote, with flat keys. The prefix is `name.`, or empty if the name is. Refuses other
    /// text.
    pub fn scores(source: &str, name: &str, text: &str) -> Result<Self, Refusal> {
        const WANTED: &str = "wanted one JSON object";
        let value = serde_json::from_str(text).map_err(|error| Refusal::new(format!("not JSON ({error})"), WANTED))?;
        let Value::Object(object) = value else {
            return Err(Refusal::new("JSON that is not an object", WANTED));
        };
        let values = RunRecord::of(&object, source)?.values;
        let prefix = if name.is_empty() { String::new() } else { format!("{name}.") };
        Ok(Self { source: source.to_owned(), prefix, values })
    }
}

/// The entries of all sources as one record, in their order. Refuses a key from two sources and names both.
pub fn join(sources: Vec<Entries>) -> Result<Map<String, Value>, Refusal> {
    let mut record = Map::new();
    let mut names: Vec<String> = Vec::new();
    for Entries { source, prefix, values } in sources {
        for (key, value) in values {
            let key = format!("{prefix}{key}");
            if let Some(known) = record.keys().position(|known| *known == key) {
                let found = format!("the key {key} from {} and from {source}", names[known]);
                return Err(Refusal::new(found, "wanted every key once, or NAME: before a file"));
            }
            record.insert(key, value);
            names.push(source.clone());
        }
    }
    Ok(record)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn arguments_are_settings_or_files() {
        for (word, wanted) in [
            ("set.iterations=60", Argument::Setting("set.iterations", json!(60))),
            ("note=a:b/c=d", Argument::Setting("note", json!("a:b/c=d"))),
            ("empty=", Argument::Setting("empty", json!(""))),
            ("mart:run/a=b.json", Argument::File("mart", "run/a=b.json")),
            ("run/a=b:c.json", Argument::File("", "run/a=b:c.json")),
            ("scores.json", Argument::File("", "scores.json")),
            ("-", Argument::File("", "-")),
        ] {
            assert_eq!(Argument::parse(word), Ok(wanted));
        }
        for word in ["", "=1", ":file", "name:"] {
            assert!(Argument::parse(word).is_err(), "{word}");
        }
    }

    #[test]
    fn settings_and_files_become_one_record() {
        let stats = Entries::scores("stats.json", "mart", "{\"seconds\": 2.5, \"counts\": {\"kept\": 3}}").unwrap();
        let joined = join(vec![Entries::setting("name", json!("base")), stats]).unwrap();
        let text = Value::Object(joined).to_string();
        assert_eq!(text, "{\"name\":\"base\",\"mart.seconds\":2.5,\"mart.counts.kept\":3}");
    }

    #[test]
    fn a_key_given_twice_names_both_sources() {
        let one = Entries::scores("one.json", "", "{\"q\": 1}").unwrap();
        let refusal = join(vec![one, Entries::setting("q", json!(2))]).unwrap_err();
        assert_eq!(refusal.found, "the key q from one.json and from q=2");
        assert!(Entries::scores("list.json", "", "[1]").is_err() && Entries::scores("two.json", "", "{} {}").is_err());
    }
}
