//! The header of a NetCDF file in the classic format with 64-bit offsets, and its values.
//!
//! Source: "NetCDF Classic Format Specification" of Unidata. A file is a header, then the values of every variable
//! without the record dimension, then the records: record 0 of each variable that has it, record 1 of each, and so on.
//! Numbers are big-endian. Names, texts and the values of a variable (or of its record) are padded to four bytes.

use crate::Refusal;
use std::io::{Result, Write};

/// Number types and their codes in the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NumberType {
    Byte = 1,
    Float = 5,
    Double = 6,
}

impl NumberType {
    fn bytes(self) -> u64 {
        match self {
            Self::Byte => 1,
            Self::Float => 4,
            Self::Double => 8,
        }
    }
}

/// The value of an attribute.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Text(String),
    Bytes(Vec<i8>),
    Floats(Vec<f32>),
    Doubles(Vec<f64>),
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// Names and values of attributes.
pub(super) type Attributes = Vec<(&'static str, Value)>;

/// A variable: its dimensions by number, the slowest first.
pub(super) struct Variable {
    pub name: String,
    pub dimensions: Vec<usize>,
    pub kind: NumberType,
    pub attributes: Attributes,
}

/// The content of a header.
pub(super) struct NetcdfHeader {
    /// Name and length of each dimension. The record dimension, if there is one, is the first.
    pub dimensions: Vec<(&'static str, usize)>,
    /// Whether the first dimension is that of the records.
    pub has_records: bool,
    pub attributes: Attributes,
    /// Variables without the record dimension first.
    pub variables: Vec<Variable>,
}

/// Largest size of a variable, bytes.
const LARGEST: u64 = u32::MAX as u64 - 3;
const DIMENSIONS: u32 = 10;
const VARIABLES: u32 = 11;
const ATTRIBUTES: u32 = 12;

impl NetcdfHeader {
    /// The bytes of the header. Refuses a variable, or a record of it, of 4 GiB or more.
    pub fn bytes(&self) -> std::result::Result<Vec<u8>, Refusal> {
        let sizes: Vec<u64> = self.variables.iter().map(|variable| self.size(variable)).collect();
        if let Some((size, variable)) = sizes.iter().zip(&self.variables).find(|(size, _)| **size > LARGEST) {
            let found = format!("{size} bytes of {}", variable.name);
            return Err(Refusal::new(found, "wanted less than 4 GiB, the limit of the format"));
        }
        // Offsets have a fixed size, so that the header's length does not depend on them.
        let start = self.with_places(&sizes, 0).len() as u64;
        Ok(self.with_places(&sizes, start))
    }

    /// Bytes of a variable, or of one record of it, padded.
    fn size(&self, variable: &Variable) -> u64 {
        let counts = variable.dimensions.iter().filter(|n| !self.is_record(**n)).map(|n| self.dimensions[*n].1 as u64);
        (counts.product::<u64>() * variable.kind.bytes()).next_multiple_of(4)
    }

    fn is_record(&self, dimension: usize) -> bool {
        self.has_records && dimension == 0
    }

    /// The header of variables whose values follow each other from byte `start`.
    fn with_places(&self, sizes: &[u64], start: u64) -> Vec<u8> {
        let mut bytes = b"CDF\x02".to_vec();
        number(&mut bytes, if self.has_records { self.dimensions[0].1 } else { 0 } as u32);
        list(&mut bytes, DIMENSIONS, self.dimensions.len());
        for (n, (name, length)) in self.dimensions.iter().enumerate() {
            text(&mut bytes, name);
            number(&mut bytes, if self.is_record(n) { 0 } else { *length as u32 });
        }
        attributes(&mut bytes, &self.attributes);
        list(&mut bytes, VARIABLES, self.variables.len());
        let mut place = start;
        for (variable, size) in self.variables.iter().zip(sizes) {
            text(&mut bytes, &variable.name);
            number(&mut bytes, variable.dimensions.len() as u32);
            variable.dimensions.iter().for_each(|n| number(&mut bytes, *n as u32));
            attributes(&mut bytes, &variable.attributes);
            number(&mut bytes, variable.kind as u32);
            number(&mut bytes, *size as u32);
            bytes.extend(place.to_be_bytes());
            place += size;
        }
        bytes
    }
}

fn number(bytes: &mut Vec<u8>, value: u32) {
    bytes.extend(value.to_be_bytes());
}

/// The start of a list. An empty one has two zeros.
fn list(bytes: &mut Vec<u8>, tag: u32, count: usize) {
    number(bytes, if count == 0 { 0 } else { tag });
    number(bytes, count as u32);
}

fn pad(bytes: &mut Vec<u8>) {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
}

fn text(bytes: &mut Vec<u8>, text: &str) {
    number(bytes, text.len() as u32);
    bytes.extend(text.as_bytes());
    pad(bytes);
}

fn attributes(bytes: &mut Vec<u8>, attributes: &Attributes) {
    const TEXT: u32 = 2;
    list(bytes, ATTRIBUTES, attributes.len());
    for (name, value) in attributes {
        text(bytes, name);
        let (kind, count) = match value {
            Value::Text(text) => (TEXT, text.len()),
            Value::Bytes(values) => (NumberType::Byte as u32, values.len()),
            Value::Floats(values) => (NumberType::Float as u32, values.len()),
            Value::Doubles(values) => (NumberType::Double as u32, values.len()),
        };
        number(bytes, kind);
        number(bytes, count as u32);
        match value {
            Value::Text(text) => bytes.extend(text.as_bytes()),
            Value::Bytes(values) => bytes.extend(values.iter().map(|value| *value as u8)),
            Value::Floats(values) => values.iter().for_each(|value| bytes.extend(value.to_be_bytes())),
            Value::Doubles(values) => values.iter().for_each(|value| bytes.extend(value.to_be_bytes())),
        }
        pad(bytes);
    }
}

/// Writes the values of a variable, or of its record.
pub(super) fn write_floats(out: &mut dyn Write, values: impl Iterator<Item = f32>) -> Result<()> {
    values.into_iter().try_for_each(|value| out.write_all(&value.to_be_bytes()))
}

/// Writes the values of a variable, or of its record.
pub(super) fn write_doubles(out: &mut dyn Write, values: impl Iterator<Item = f64>) -> Result<()> {
    values.into_iter().try_for_each(|value| out.write_all(&value.to_be_bytes()))
}

/// Writes the values of a variable, or of its record, padded.
pub(super) fn write_bytes(out: &mut dyn Write, values: impl Iterator<Item = i8>) -> Result<()> {
    let mut bytes: Vec<u8> = values.map(|value| value as u8).collect();
    pad(&mut bytes);
    out.write_all(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_as_the_specification_lays_it_out() {
        let header = NetcdfHeader {
            dimensions: vec![("x", 3)],
            has_records: false,
            attributes: vec![("a", Value::Floats(vec![1.0]))],
            variables: vec![Variable {
                name: "vx".to_owned(),
                dimensions: vec![0],
                kind: NumberType::Byte,
                attributes: Vec::new(),
            }],
        };
        let mut wanted = b"CDF\x02\0\0\0\0".to_vec();
        wanted.extend(b"\0\0\0\x0a\0\0\0\x01\0\0\0\x01x\0\0\0\0\0\0\x03");
        wanted.extend(b"\0\0\0\x0c\0\0\0\x01\0\0\0\x01a\0\0\0\0\0\0\x05\0\0\0\x01\x3f\x80\0\0");
        wanted.extend(b"\0\0\0\x0b\0\0\0\x01\0\0\0\x02vx\0\0\0\0\0\x01\0\0\0\0");
        wanted.extend(b"\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\x04");
        let place = wanted.len() as u64 + 8;
        wanted.extend(place.to_be_bytes());
        assert_eq!(header.bytes().unwrap(), wanted);
    }

    #[test]
    fn a_variable_of_4_gib_is_refused() {
        let long = NetcdfHeader {
            dimensions: vec![("x", 1 << 30)],
            has_records: false,
            attributes: Vec::new(),
            variables: vec![Variable {
                name: "u".to_owned(),
                dimensions: vec![0],
                kind: NumberType::Float,
                attributes: Vec::new(),
            }],
        };
        assert!(long.bytes().unwrap_err().found.starts_with("4294967296 bytes of u"));
    }
}
