//! Settings, their front and the effects of factors.

use crate::{runs::median_range::MedianRange, runs::missing::MissingKeys};
use serde_json::Value;

/// The keys that are compared.
#[derive(Debug, Clone)]
pub struct TradeKeys {
    /// Key of a setting's name.
    pub name: String,
    /// Key of the cost.
    pub cost: String,
    /// Key of the error.
    pub error: String,
    /// Key of the memory.
    pub memory: String,
    /// Name of the setting that others are compared with.
    pub base: Option<String>,
}

/// Cost and error of all settings, the front among them, and the effects of single factors.
#[derive(Debug, Clone)]
pub struct Trade {
    /// The keys that were compared.
    pub keys: TradeKeys,
    /// Runs that were read and selected.
    pub runs: usize,
    /// Settings by rising cost.
    pub settings: Vec<Setting>,
    /// Indices of the settings on the Pareto front, by rising cost.
    pub front: Vec<usize>,
    /// Factors by key: settings that differ from the base in one key.
    pub factors: Vec<Factor>,
    /// Indices of settings that differ from the base in more than one key, or in none.
    pub ungrouped: Vec<usize>,
    /// Runs that lack a key.
    pub missing: MissingKeys,
}

/// The runs of one name.
#[derive(Debug, Clone)]
pub struct Setting {
    /// The name.
    pub name: String,
    /// Cost over the runs.
    pub cost: MedianRange,
    /// Error over the runs.
    pub error: MedianRange,
    /// Memory over the runs that have it.
    pub memory: MedianRange,
    /// Keys `set.*` without that prefix, by alphabet, and their values.
    pub set: Vec<(String, Value)>,
    /// Index of the setting on the front that has at most this cost and the least error. None on the front.
    pub dominated_by: Option<usize>,
}

/// A key in which some settings differ from the base, and in nothing else.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// The key without `set.`.
    pub key: String,
    /// Its value in the base. Null if the base lacks it.
    pub base: Value,
    /// Effects, sorted by value.
    pub effects: Vec<Effect>,
}

/// A setting relative to the base.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// Index of the setting.
    pub setting: usize,
    /// Value of the factor.
    pub value: Value,
    /// Cost over the base's.
    pub cost_ratio: f64,
    /// Error over the base's.
    pub error_ratio: f64,
    /// Memory over the base's.
    pub memory_ratio: f64,
}

impl Setting {
    /// Value of a key `set.*`, without that prefix. Null if the setting lacks it.
    pub(super) fn value(&self, key: &str) -> Value {
        self.set.iter().find(|(known, _)| known == key).map(|(_, value)| value.clone()).unwrap_or_default()
    }
}

impl Trade {
    /// Index of the base.
    pub fn base(&self) -> Option<usize> {
        self.settings.iter().position(|setting| Some(&setting.name) == self.keys.base.as_ref())
    }

    /// Names of the settings with at most this cost and this error, by rising cost.
    pub fn within(&self, max_cost: Option<f64>, max_error: Option<f64>) -> Vec<&str> {
        let keeps = |value: f64, limit: Option<f64>| limit.is_none_or(|limit| value <= limit);
        let within = self
            .settings
            .iter()
            .filter(|setting| keeps(setting.cost.median, max_cost) && keeps(setting.error.median, max_error));
        within.map(|setting| setting.name.as_str()).collect()
    }
}
