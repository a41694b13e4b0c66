//! One line about many stored values.

use serde::Serialize;

/// Extremes and sums of stored values; the values that are not finite are counted and left out of the rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Summary {
    /// How many values.
    pub count: usize,
    /// How many of them are NaN or infinite.
    pub not_finite: usize,
    /// How many are zero.
    pub zero: usize,
    /// Smallest; NaN where nothing is finite.
    pub min: f64,
    /// Largest.
    pub max: f64,
    /// Sum over mean.
    pub sum: f64,
}

impl Summary {
    /// The summary of `values`.
    pub fn of<'a>(values: impl IntoIterator<Item = &'a f32>) -> Self {
        let mut summary = Self { count: 0, not_finite: 0, zero: 0, min: f64::NAN, max: f64::NAN, sum: 0.0 };
        for &value in values {
            summary.count += 1;
            if !value.is_finite() {
                summary.not_finite += 1;
                continue;
            }
            let value = f64::from(value);
            summary.zero += usize::from(value == 0.0);
            summary.min = summary.min.min(value);
            summary.max = summary.max.max(value);
            summary.sum += value;
        }
        summary
    }

    /// Mean of the finite values; NaN where nothing is finite.
    pub fn mean(&self) -> f64 {
        self.sum / (self.count - self.not_finite) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summary_sets_aside_what_is_not_finite() {
        let summary = Summary::of(&[0.0, f32::NAN, -2.0, f32::INFINITY, 5.0]);
        assert_eq!((summary.count, summary.not_finite, summary.zero), (5, 2, 1));
        assert_eq!((summary.min, summary.max, summary.mean()), (-2.0, 5.0, 1.0));
        assert!(Summary::of(&[]).mean().is_nan());
    }
}
