//! One record of a run, of settings and of what tools wrote about it.

use super::record::{Record, Refusal, plain, typed};
use serde_json::{Map, Value};

/// What an argument asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Word<'a> {
    /// `KEY=VALUE`.
    Setting(&'a str, Value),
    /// `FILE`, or `NAME:FILE`: what keys start with, and the file.
    File(&'a str, &'a str),
}

impl<'a> Word<'a> {
    /// The first of `=`, `:` and `/` decides: a setting, a named file or a file.
    ///
    /// # Errors
    /// A key, a name or a file without a letter.
    pub fn parse(word: &'a str) -> Result<Self, Refusal> {
        let (parsed, is_whole) =
            match word.find(['=', ':', '/']).map(|at| (&word[..at], &word[at..at + 1], &word[at + 1..])) {
                Some((key, "=", value)) => (Self::Setting(key, typed(value)), !key.is_empty()),
                Some((name, ":", file)) => (Self::File(name, file), !name.is_empty() && !file.is_empty()),
                _ => (Self::File("", word), !word.is_empty()),
            };
        let wanted = "wanted KEY=VALUE, FILE or NAME:FILE";
        if is_whole { Ok(parsed) } else { Err((format!("'{word}'"), wanted.into())) }
    }
}

/// A part of a record, and what to call it in a message.
pub struct Part {
    /// A file's name, or the setting as it was typed.
    pub source: String,
    /// What every key starts with.
    pub before: String,
    /// The keys.
    pub values: Map<String, Value>,
}

impl Part {
    /// One setting.
    pub fn setting(key: &str, value: Value) -> Self {
        let source = format!("{key}={}", plain(&value));
        Self { source, before: String::new(), values: Map::from_iter([(key.to_owned(), value)]) }
    }

    /// What a tool wrote: one JSON object, its keys made flat, `name.` before each unless the name is empty.
    ///
    /// # Errors
    /// Text that is not one JSON object.
    pub fn scores(source: &str, name: &str, text: &str) -> Result<Self, Refusal> {
        const WANTED: &str = "wanted one JSON object";
        let value: Value =
            serde_json::from_str(text).map_err(|error| (format!("not JSON ({error})"), WANTED.to_string()))?;
        let Value::Object(object) = value else {
            return Err(("JSON that is no object".into(), WANTED.into()));
        };
        let values = Record::of(&object, source)?.values;
        let before = if name.is_empty() { String::new() } else { format!("{name}.") };
        Ok(Self { source: source.to_owned(), before, values })
    }
}

/// The keys of all parts, in their order. As JSON it is one line.
///
/// # Errors
/// A key that two parts give, with the names of both.
pub fn line(parts: Vec<Part>) -> Result<Map<String, Value>, Refusal> {
    let mut line = Map::new();
    let mut sources: Vec<String> = Vec::new();
    for part in parts {
        for (key, value) in part.values {
            let key = format!("{}{key}", part.before);
            if let Some(known) = line.keys().position(|known| *known == key) {
                let found = format!("the key {key} from {} and from {}", sources[known], part.source);
                return Err((found, "wanted every key once, or NAME: before a file".into()));
            }
            line.insert(key, value);
            sources.push(part.source.clone());
        }
    }
    Ok(line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn words_are_settings_or_files() {
        for (word, wanted) in [
            ("set.iterations=60", Word::Setting("set.iterations", json!(60))),
            ("note=a:b/c=d", Word::Setting("note", json!("a:b/c=d"))),
            ("empty=", Word::Setting("empty", json!(""))),
            ("mart:run/a=b.json", Word::File("mart", "run/a=b.json")),
            ("run/a=b:c.json", Word::File("", "run/a=b:c.json")),
            ("scores.json", Word::File("", "scores.json")),
            ("-", Word::File("", "-")),
        ] {
            assert_eq!(Word::parse(word), Ok(wanted));
        }
        for word in ["", "=1", ":file", "name:"] {
            assert!(Word::parse(word).is_err(), "{word}");
        }
    }

    #[test]
    fn parts_become_one_line() {
        let stats = Part::scores("stats.json", "mart", "{\"seconds\": 2.5, \"counts\": {\"kept\": 3}}").unwrap();
        let line = line(vec![Part::setting("name", json!("base")), stats]).unwrap();
        let text = Value::Object(line).to_string();
        assert_eq!(text, "{\"name\":\"base\",\"mart.seconds\":2.5,\"mart.counts.kept\":3}");
    }

    #[test]
    fn a_key_given_twice_names_both() {
        let one = Part::scores("one.json", "", "{\"q\": 1}").unwrap();
        let (found, _) = line(vec![one, Part::setting("q", json!(2))]).unwrap_err();
        assert_eq!(found, "the key q from one.json and from q=2");
        assert!(Part::scores("list.json", "", "[1]").is_err() && Part::scores("two.json", "", "{} {}").is_err());
    }
}
