//! A mistake in a JSON value: what it is, and where.

use serde::de::{Error, Expected, Unexpected};
use std::fmt::{self, Display};

/// A mistake, without its place.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Mistake {
    /// A key that must be there is not.
    Missing(&'static str),
    /// A key that does not exist, and those that do.
    Unknown(String, &'static [&'static str]),
    /// A word that is no value of its key, and those that are.
    Word(String, &'static [&'static str]),
    /// Anything else, in words that follow the name of the place.
    Other(String),
}

/// A mistake and the path of the object or value that has it. The reader adds the path.
#[derive(Debug, Clone)]
pub(super) struct Fault {
    pub mistake: Mistake,
    pub path: Option<String>,
}

impl From<Mistake> for Fault {
    fn from(mistake: Mistake) -> Self {
        Self { mistake, path: None }
    }
}

impl Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{:?}", self.mistake)
    }
}

impl std::error::Error for Fault {}

/// The words of serde for a wanted type, in words for people.
fn wanted(expected: &dyn Expected) -> String {
    let words = expected.to_string();
    match words.as_str() {
        "f64" | "f32" => "a number".to_owned(),
        "usize" | "u64" | "u32" | "u16" | "u8" => "a whole number of 0 or more".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "path string" => "a text".to_owned(),
        words if words.contains("enum ") => "a word".to_owned(),
        words if words.starts_with("struct ") => "an object of keys and values".to_owned(),
        _ => words,
    }
}

/// The words for a value that has another type than wanted.
fn seen(found: Unexpected) -> String {
    match found {
        Unexpected::Bool(value) => value.to_string(),
        Unexpected::Unsigned(value) => value.to_string(),
        Unexpected::Signed(value) => value.to_string(),
        Unexpected::Float(value) => value.to_string(),
        Unexpected::Str(text) => format!("\"{text}\""),
        Unexpected::Unit => "null".to_owned(),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Map => "an object".to_owned(),
        other => other.to_string(),
    }
}

impl Error for Fault {
    fn custom<T: Display>(words: T) -> Self {
        let words = words.to_string();
        let is_choice = words.starts_with("data did not match any variant");
        Mistake::Other(if is_choice { "has a form that is not known".to_owned() } else { words }).into()
    }

    fn invalid_type(found: Unexpected, expected: &dyn Expected) -> Self {
        Mistake::Other(format!("is {}, not {}", seen(found), wanted(expected))).into()
    }

    fn invalid_value(found: Unexpected, expected: &dyn Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(length: usize, expected: &dyn Expected) -> Self {
        let expected = expected.to_string().replace("an array of length ", "");
        Mistake::Other(format!("has {length} entries, not {expected}")).into()
    }

    fn missing_field(key: &'static str) -> Self {
        Mistake::Missing(key).into()
    }

    fn unknown_field(key: &str, known: &'static [&'static str]) -> Self {
        Mistake::Unknown(key.to_owned(), known).into()
    }

    fn unknown_variant(word: &str, known: &'static [&'static str]) -> Self {
        Mistake::Word(word.to_owned(), known).into()
    }
}
