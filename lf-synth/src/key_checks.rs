//! Checks of the keys of a scene that its parts share.

use lf_core::{Refusal, scene::WANTED};
use std::ops::RangeInclusive;

pub(crate) fn wrong(found: impl Into<String>) -> Refusal {
    Refusal::new(found, WANTED)
}

/// Refuses a value that is not above 0 and below 1e12.
pub(crate) fn positive(key: &str, value: f64) -> Result<(), Refusal> {
    if value > 0.0 && value < 1e12 { Ok(()) } else { Err(wrong(format!("{key} is {value}, not a positive number"))) }
}

/// Refuses a value outside a range.
pub(crate) fn within(key: &str, value: f64, range: RangeInclusive<f64>) -> Result<(), Refusal> {
    let (low, high) = (range.start(), range.end());
    if range.contains(&value) { Ok(()) } else { Err(wrong(format!("{key} is {value}, outside {low} to {high}"))) }
}

/// Refuses a value that is not between -1e12 and 1e12.
pub(crate) fn finite(key: &str, value: f64) -> Result<(), Refusal> {
    if (-1e12..1e12).contains(&value) { Ok(()) } else { Err(wrong(format!("{key} is {value}, not a finite number"))) }
}
