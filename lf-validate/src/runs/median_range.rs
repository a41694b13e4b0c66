//! Median and range over runs.

use lf_core::statistics::median;

/// Median, least and greatest of some numbers. NaN, `null` in JSON, without numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MedianRange {
    /// Median.
    pub median: f64,
    /// Least.
    pub low: f64,
    /// Greatest.
    pub high: f64,
    /// Numbers that are finite: the runs that have one.
    pub runs: usize,
}

impl MedianRange {
    /// Median and range of the finite values.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
        let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max]
            .map(|pick| values.iter().copied().reduce(pick).unwrap_or(f64::NAN));
        Self { low, high, runs: values.len(), median: median(&mut values) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_finite_values_count() {
        assert_eq!(MedianRange::of([3.0, f64::NAN, 1.0]), MedianRange { median: 2.0, low: 1.0, high: 3.0, runs: 2 });
        assert!(MedianRange::of([]).low.is_nan());
    }
}
