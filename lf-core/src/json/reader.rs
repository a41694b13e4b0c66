//! A deserializer of JSON values that passes over the mistakes already found, so that the next one is found.

use super::fault::{Fault, Mistake};
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{DeserializeSeed, Deserializer, Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::forward_to_deserialize_any;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// The mistakes to pass over.
#[derive(Default)]
pub(super) struct Known {
    /// Missing keys, by the path of their object. The number selects a value of [`stand_in`].
    pub missing: BTreeMap<(String, &'static str), usize>,
    /// Paths of keys that do not exist.
    pub unknown: BTreeSet<String>,
    /// Paths of values that are wrong.
    pub wrong: BTreeSet<String>,
}

/// Number of values that replace a missing key of unknown type.
pub(super) const STAND_INS: usize = 4;

fn stand_in(number: usize) -> Value {
    [json!(1), json!("x"), json!([1, 1, 1]), json!([1, 1])][number.min(STAND_INS - 1)].clone()
}

/// The value at a path; `None` is a mistake that is passed over, and gives a value of any wanted type.
#[derive(Clone)]
pub(super) struct Reader<'a> {
    pub value: Option<&'a Value>,
    pub path: String,
    pub known: &'a Known,
    /// Which of [`STAND_INS`] is given where any value is wanted.
    pub stand_in: usize,
}

type Read<T> = Result<T, Fault>;

impl<'a> Reader<'a> {
    pub fn new(value: &'a Value, known: &'a Known) -> Self {
        Self { value: Some(value), path: String::new(), known, stand_in: 0 }
    }

    /// The value as a seed reads it. Types that buffer a value find their faults after its reader has returned.
    fn give<'de, T: DeserializeSeed<'de>>(self, seed: T) -> Read<T::Value> {
        let path = self.path.clone();
        Self::placed(&path, seed.deserialize(self))
    }

    fn at(&self, value: Option<&'a Value>, path: String, stand_in: usize) -> Self {
        Self { value: value.filter(|_| !self.known.wrong.contains(&path)), path, known: self.known, stand_in }
    }

    fn member(&self, key: &str, value: Option<&'a Value>, stand_in: usize) -> Self {
        self.at(value, member(&self.path, key), stand_in)
    }

    /// Adds this reader's path to a fault that has none.
    fn placed<T>(path: &str, outcome: Read<T>) -> Read<T> {
        outcome.map_err(|fault| Fault { path: fault.path.or_else(|| Some(path.to_owned())), ..fault })
    }

    /// The keys of an object that are read: those that exist, then those that are missing.
    fn keys(&self, map: &'a Map<String, Value>) -> Vec<(&'a str, Reader<'a>)> {
        let exists = |key: &str| !self.known.unknown.contains(&member(&self.path, key));
        let there = map.iter().filter(|(key, _)| exists(key));
        let missing = self.known.missing.iter().filter(|((path, _), _)| *path == self.path);
        there
            .map(|(key, value)| (key.as_str(), self.member(key, Some(value), 0)))
            .chain(missing.map(|((_, key), number)| (*key, self.member(key, None, *number))))
            .collect()
    }
}

/// The path of a key of the object at `path`.
pub(super) fn member(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

fn by_word(word: &str) -> StrDeserializer<'_, Fault> {
    word.into_deserializer()
}

/// Keys and their readers, in turn.
struct Entries<'a> {
    entries: std::vec::IntoIter<(&'a str, Reader<'a>)>,
    next: Option<Reader<'a>>,
}

impl<'a> Entries<'a> {
    fn new(entries: Vec<(&'a str, Reader<'a>)>) -> Self {
        Self { entries: entries.into_iter(), next: None }
    }
}

impl<'de> MapAccess<'de> for Entries<'_> {
    type Error = Fault;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Read<Option<K::Value>> {
        let Some((key, reader)) = self.entries.next() else { return Ok(None) };
        self.next = Some(reader);
        seed.deserialize(by_word(key)).map(Some)
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Read<V::Value> {
        self.next.take().ok_or_else(|| Fault::custom("has a value without a key"))?.give(seed)
    }
}

/// The entries of a list, in turn.
struct JsonList<'a>(std::vec::IntoIter<Reader<'a>>);

impl<'de> SeqAccess<'de> for JsonList<'_> {
    type Error = Fault;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Read<Option<T::Value>> {
        self.0.next().map(|reader| reader.give(seed)).transpose()
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

impl<'de> Deserializer<'de> for Reader<'_> {
    type Error = Fault;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Read<V::Value> {
        let stand_in = stand_in(self.stand_in);
        let reader =
            if self.value.is_some() { self.clone() } else { Reader { value: Some(&stand_in), ..self.clone() } };
        let outcome = match reader.value.unwrap_or(&Value::Null) {
            Value::Null => visitor.visit_unit(),
            Value::Bool(value) => visitor.visit_bool(*value),
            Value::Number(number) => match (number.as_u64(), number.as_i64()) {
                (Some(number), _) => visitor.visit_u64(number),
                (None, Some(number)) => visitor.visit_i64(number),
                _ => visitor.visit_f64(number.as_f64().unwrap_or(f64::NAN)),
            },
            Value::String(text) => visitor.visit_str(text),
            Value::Array(list) => {
                let entry = |(n, value)| reader.at(Some(value), format!("{}[{n}]", reader.path), 0);
                let mut entries = JsonList(list.iter().enumerate().map(entry).collect::<Vec<_>>().into_iter());
                visitor.visit_seq(&mut entries).and_then(|read| match entries.0.len() {
                    0 => Ok(read),
                    _ => Err(Mistake::Other(format!("has {} entries, more than wanted", list.len())).into()),
                })
            }
            Value::Object(map) => visitor.visit_map(Entries::new(reader.keys(map))),
        };
        Reader::placed(&self.path, outcome)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Read<V::Value> {
        if self.value.is_none_or(Value::is_null) { visitor.visit_none() } else { visitor.visit_some(self) }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Read<V::Value> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        keys: &'static [&'static str],
        visitor: V,
    ) -> Read<V::Value> {
        match self.value {
            // The types would take a list of values in the order of their keys.
            Some(Value::Array(_)) => {
                let fault = Mistake::Other("is a list, not an object of keys and values".to_owned()).into();
                return Reader::placed(&self.path, Err(fault));
            }
            Some(_) => return self.deserialize_any(visitor),
            None => {}
        }
        visitor.visit_map(Entries::new(keys.iter().map(|key| (*key, self.member(key, None, 0))).collect()))
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Read<V::Value> {
        if self.value.is_some() {
            return self.deserialize_any(visitor);
        }
        visitor.visit_seq(JsonList(vec![self; length].into_iter()))
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Read<V::Value> {
        if self.value.is_some() {
            self.deserialize_any(visitor)
        } else {
            visitor.visit_seq(JsonList(Vec::new().into_iter()))
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        words: &'static [&'static str],
        visitor: V,
    ) -> Read<V::Value> {
        let path = self.path.clone();
        let outcome = match self.value {
            None => visitor.visit_enum(by_word(words.first().copied().unwrap_or_default())),
            Some(Value::String(word)) => visitor.visit_enum(by_word(word)),
            Some(Value::Object(map)) => visitor.visit_enum(MapAccessDeserializer::new(Entries::new(self.keys(map)))),
            Some(_) => return self.deserialize_any(visitor),
        };
        Reader::placed(&path, outcome)
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Read<V::Value> {
        if self.value.is_some() { self.deserialize_any(visitor) } else { visitor.visit_str("x") }
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Read<V::Value> {
        self.deserialize_string(visitor)
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Read<V::Value> {
        if self.value.is_some() { self.deserialize_any(visitor) } else { visitor.visit_bool(false) }
    }

    forward_to_deserialize_any! {
        i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char bytes byte_buf unit unit_struct map tuple_struct identifier
        ignored_any
    }
}
