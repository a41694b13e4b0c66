//! Statistics of errors about zero.

use lf_core::statistics::median;

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
}

impl ErrorSpread {
    /// The bias is known before the standard deviation is summed.
    pub fn of(errors: &[f64]) -> Self {
        let count = errors.len() as f64;
        let bias = errors.iter().sum::<f64>() / count;
        let std = (errors.iter().map(|e| (e - bias).powi(2)).sum::<f64>() / count).sqrt();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
        Self { bias, rms, std, median_abs: median(&mut errors.iter().map(|e| e.abs()).collect::<Vec<f64>>()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_of_four_errors_by_hand() {
        let spread = ErrorSpread::of(&[1.0, -1.0, 3.0, 5.0]);
        assert_eq!(spread, ErrorSpread { bias: 2.0, rms: 3.0, std: 5f64.sqrt(), median_abs: 2.0 });
        assert!(ErrorSpread::of(&[]).rms.is_nan());
    }
}
