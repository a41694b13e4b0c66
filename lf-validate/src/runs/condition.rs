//! Which runs are used.

use super::record::RunRecord;
use super::values::{is_same, plain};
use lf_core::Refusal;
use serde_json::Value;
use std::fmt;

/// A key of a record and the value that it must have: `KEY=VALUE`.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// The key.
    pub key: String,
    /// Its value.
    pub value: Value,
}

impl Condition {
    /// Whether a record has the value.
    pub fn holds(&self, record: &RunRecord) -> bool {
        record.get(&self.key).is_some_and(|value| is_same(value, &self.value))
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "{}={}", self.key, plain(&self.value))
    }
}

/// The records that meet all conditions.
///
/// # Errors
/// There is no record, or none meets the conditions.
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
