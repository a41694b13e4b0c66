//! Numbers that stand for many numbers.

use serde::Serialize;

/// Scale from the median absolute deviation to the standard deviation of a normal distribution, 1 / Phi^-1(3/4).
const NORMAL_PER_MAD: f64 = 1.482_602_218_505_602;

/// How a set of errors lies about zero. NaN, `null` in JSON, where there are none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Mean.
    pub bias: f64,
    /// Root of the mean square about zero: rms^2 = bias^2 + std^2.
    pub rms: f64,
    /// Standard deviation about the bias, by n and not n - 1.
    pub std: f64,
    /// Median of the sizes.
    pub median_abs: f64,
}

impl Spread {
    /// The spread of `errors`, by two passes for bias and std and a selection for the median.
    pub fn of(errors: &[f64]) -> Self {
        let count = errors.len() as f64;
        let bias = errors.iter().sum::<f64>() / count;
        let std = (errors.iter().map(|e| (e - bias).powi(2)).sum::<f64>() / count).sqrt();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
        Self { bias, rms, std, median_abs: median(errors.iter().map(|e| e.abs()).collect()) }
    }
}

/// The middle value, or the mean of the two in the middle; NaN of nothing. Linear in the count.
pub fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let half = values.len() / 2;
    let odd = values.len() % 2 == 1;
    let (below, &mut middle, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    if odd { middle } else { 0.5 * (middle + below.iter().copied().fold(f64::NEG_INFINITY, f64::max)) }
}

/// The value that a share of the values is below, linear between neighbours in order; NaN of nothing.
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    values.sort_unstable_by(f64::total_cmp);
    let place = share * (values.len() - 1) as f64;
    let (below, above) = (values[place.floor() as usize], values[place.ceil() as usize]);
    below + (place - place.floor()) * (above - below)
}

/// Median and robust standard deviation: the median absolute deviation scaled to a normal distribution.
pub fn robust(values: &[f64]) -> (f64, f64) {
    let centre = median(values.to_vec());
    (centre, NORMAL_PER_MAD * median(values.iter().map(|value| (value - centre).abs()).collect()))
}

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
    fn spread_of_four_errors_by_hand() {
        let spread = Spread::of(&[1.0, -1.0, 3.0, 5.0]);
        assert_eq!(spread, Spread { bias: 2.0, rms: 3.0, std: 5f64.sqrt(), median_abs: 2.0 });
        assert!(Spread::of(&[]).rms.is_nan());
    }

    #[test]
    fn median_of_odd_even_and_equal_counts() {
        assert_eq!(median(vec![9.0, 1.0, 5.0]), 5.0);
        assert_eq!(median(vec![9.0, 1.0, 5.0, 3.0]), 4.0);
        assert_eq!(median(vec![2.0; 6]), 2.0);
        assert!(median(Vec::new()).is_nan());
    }

    #[test]
    fn quantiles_between_values() {
        let values = vec![4.0, 1.0, 3.0, 2.0];
        assert_eq!([0.0, 0.5, 0.9, 1.0].map(|share| quantile(values.clone(), share)), [1.0, 2.5, 3.7, 4.0]);
        assert!(quantile(Vec::new(), 0.5).is_nan());
    }

    #[test]
    fn robust_sigma_ignores_a_wild_value() {
        let mut values: Vec<f64> = (-50..=50).map(f64::from).collect();
        values.push(1e9);
        let (centre, sigma) = robust(&values);
        assert!(centre.abs() <= 0.5 && (sigma - 25.5 * NORMAL_PER_MAD).abs() < 1.0);
    }

    #[test]
    fn summary_sets_aside_what_is_not_finite() {
        let summary = Summary::of(&[0.0, f32::NAN, -2.0, f32::INFINITY, 5.0]);
        assert_eq!((summary.count, summary.not_finite, summary.zero), (5, 2, 1));
        assert_eq!((summary.min, summary.max, summary.mean()), (-2.0, 5.0, 1.0));
        assert!(Summary::of(&[]).mean().is_nan());
    }
}
