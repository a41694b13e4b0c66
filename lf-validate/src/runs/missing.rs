//! Runs that cannot be used because they lack a key.

use super::record::RunRecord;
use lf_core::Refusal;

/// Most keys that a refusal lists.
const MOST_KEYS: usize = 8;

/// Number of runs that lack a key, for each key.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MissingKeys(Vec<(String, usize)>);

impl MissingKeys {
    /// Counts a run without `key`.
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
