//! How errors are distributed: their spread about zero, and their density in bins.

use lf_core::statistics::{median, quantile};
use serde::ser::SerializeMap;

/// Root of the mean of `squares`. NaN without any.
pub(crate) fn root_mean(squares: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
    (sum / count).sqrt()
}

/// Statistics of a set of errors about zero. NaN without errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ErrorSpread {
    /// Mean.
    pub bias: f64,
    /// Root mean square about zero: rms^2 = bias^2 + std^2.
    pub rms: f64,
    /// Standard deviation about the bias, with n and not n - 1.
    pub std: f64,
    /// Median of the absolute values.
    pub median_abs: f64,
    /// Nine in ten of the absolute values are at most this.
    pub p90: f64,
}

impl ErrorSpread {
    /// Names and values of the numbers.
    pub fn entries(&self) -> [(&'static str, f64); 5] {
        let Self { bias, rms, std, median_abs, p90 } = *self;
        [("bias", bias), ("rms", rms), ("std", std), ("median_abs", median_abs), ("p90", p90)]
    }

    /// The bias is known before the standard deviation is summed.
    pub fn of(errors: &[f64]) -> Self {
        let count = errors.len() as f64;
        let bias = errors.iter().sum::<f64>() / count;
        let std = (errors.iter().map(|e| (e - bias).powi(2)).sum::<f64>() / count).sqrt();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
        let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
        let [median_abs, p90] = [median(&mut sizes), quantile(&mut sizes, 0.9)];
        Self { bias, rms, std, median_abs, p90 }
    }
}

/// A probability density in bins of equal width. The middle bin is centred at zero.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Density {
    /// Middle of each bin.
    pub x: Vec<f64>,
    /// Per unit of x. It integrates to the share of the values inside the bins. NaN without values.
    pub density: Vec<f64>,
    /// Share of the values below the first bin.
    pub below: f64,
    /// Share of the values above the last bin.
    pub above: f64,
}

impl Density {
    /// The density of `values` in `2 reach + 1` bins, of which `per_unit` are one unit wide. A value between two bins
    /// counts in the upper one.
    pub fn of(values: &[f64], per_unit: f64, reach: usize) -> Self {
        let (mut counts, mut below, mut above) = (vec![0usize; 2 * reach + 1], 0, 0);
        for value in values {
            let bin = (value * per_unit + 0.5).floor() + reach as f64;
            if bin < 0.0 {
                below += 1;
            } else if let Some(count) = counts.get_mut(bin as usize) {
                *count += 1;
            } else {
                above += 1;
            }
        }
        let share = |count: usize| count as f64 / values.len() as f64;
        Self {
            x: (0..counts.len()).map(|bin| (bin as f64 - reach as f64) / per_unit).collect(),
            density: counts.iter().map(|&count| share(count) * per_unit).collect(),
            below: share(below),
            above: share(above),
        }
    }

    /// Adds the entries of a component: `x_u`, `u`, `below_u` and `above_u`.
    pub(super) fn serialize_as<M: SerializeMap>(&self, name: &str, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry(&format!("x_{name}"), &self.x)?;
        map.serialize_entry(name, &self.density)?;
        map.serialize_entry(&format!("below_{name}"), &self.below)?;
        map.serialize_entry(&format!("above_{name}"), &self.above)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_of_four_errors_by_hand() {
        let spread = ErrorSpread::of(&[1.0, -1.0, 3.0, 5.0]);
        assert_eq!(spread, ErrorSpread { bias: 2.0, rms: 3.0, std: 5f64.sqrt(), median_abs: 2.0, p90: spread.p90 });
        assert!((spread.p90 - 4.4).abs() < 1e-12);
        assert!(ErrorSpread::of(&[]).rms.is_nan());
    }

    #[test]
    fn bins_by_hand() {
        // Bins of 0.5 from -1.25 to 1.25: two below, one in each of three, one above.
        let found = Density::of(&[-1.3, -7.0, -1.25, 0.2, 0.25, 1.25, 1.2, 0.3], 2.0, 2);
        assert_eq!(found.x, [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(found.density, [0.25, 0.0, 0.25, 0.5, 0.25]);
        assert_eq!((found.below, found.above), (0.25, 0.125));
        let integral: f64 = found.density.iter().map(|density| density * 0.5).sum();
        assert_eq!(integral, 1.0 - found.below - found.above);
        let nothing = Density::of(&[], 2.0, 2);
        assert!(nothing.density.iter().all(|density| density.is_nan()) && nothing.below.is_nan());
    }
}
