//! Extremes and sums of many stored values.

use super::numbers::figures;
use serde::Serialize;
use std::fmt;

/// Extremes and sums of stored values. Values that are not finite are counted and left out of all other numbers. Prints
/// as one line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Summary {
    /// Number of values.
    pub count: usize,
    /// Values that are NaN or infinite.
    pub not_finite: usize,
    /// Values that are zero.
    pub zero: usize,
    /// Smallest. NaN without a finite value.
    pub min: f64,
    /// Largest. NaN without a finite value.
    pub max: f64,
    /// Sum.
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

    /// Mean of the finite values. NaN without one.
    pub fn mean(&self) -> f64 {
        self.sum / (self.count - self.not_finite) as f64
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.count == self.not_finite {
            return f.write_str(if self.count == 0 { "no values" } else { "no finite value" });
        }
        let [min, max, mean, sum] = [self.min, self.max, self.mean(), self.sum].map(figures);
        write!(f, "min {min}, max {max}, mean {mean}, sum {sum}")?;
        if self.not_finite > 0 { write!(f, ", {} not finite", self.not_finite) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_not_finite_are_only_counted() {
        let summary = Summary::of(&[0.0, f32::NAN, -2.0, f32::INFINITY, 5.0]);
        assert_eq!((summary.count, summary.not_finite, summary.zero), (5, 2, 1));
        assert_eq!((summary.min, summary.max, summary.mean()), (-2.0, 5.0, 1.0));
        assert!(Summary::of(&[]).mean().is_nan());
    }
}
