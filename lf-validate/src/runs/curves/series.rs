//! Curves over runs, as they are printed.

use crate::runs::missing::MissingKeys;
use serde::{Serialize, Serializer};

/// The keys that make the curves.
#[derive(Debug, Clone, Default, Serialize)]
pub struct CurveKeys {
    /// Key of x: a number, or a list of them.
    pub x: String,
    /// Keys of y: numbers or lists. Each gives its own series.
    pub y: Vec<String>,
    /// Keys whose values divide the runs into series.
    pub by: Vec<String>,
    /// Key whose values divide the series into panels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub panel: Option<String>,
}

/// All series of the runs.
#[derive(Debug, Clone, Serialize)]
pub struct Curves {
    /// The keys that made the curves.
    #[serde(flatten)]
    pub keys: CurveKeys,
    /// Runs that were read and selected.
    pub runs: usize,
    /// Sorted by panel, y and the values of `by`; numbers by size.
    #[serde(serialize_with = "by_name")]
    pub series: Vec<Series>,
    /// Runs that lack a key. Not in the JSON.
    #[serde(skip)]
    pub missing: MissingKeys,
}

/// One curve. All lists have the same length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// Name in its panel.
    #[serde(skip)]
    pub name: String,
    /// Name of its panel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub panel: Option<String>,
    /// Key of its values.
    pub y: String,
    /// Places: sorted, or in the order of the runs' lists. Bins given by their edges have their centres here.
    pub x: Vec<f64>,
    /// Median over the runs.
    pub median: Vec<f64>,
    /// Least value.
    pub low: Vec<f64>,
    /// Greatest value.
    pub high: Vec<f64>,
    /// Runs with a number at this place.
    pub runs: Vec<usize>,
}

/// The series as an object with their names as keys.
fn by_name<S: Serializer>(series: &[Series], serializer: S) -> Result<S::Ok, S::Error> {
    let name = |series: &Series| match &series.panel {
        Some(panel) => format!("{panel}: {}", series.name),
        None => series.name.clone(),
    };
    serializer.collect_map(series.iter().map(|series| (name(series), series)))
}
