//! Order statistics: medians, quantiles and robust spreads. NaN sorts after every number.

use std::cmp::Ordering;

/// Standard deviation of a normal distribution over its median absolute deviation: 1 / Phi^-1(3/4).
pub const NORMAL_PER_MAD: f64 = 1.482_602_218_505_602;

/// Floats with the total order of `total_cmp`.
pub trait Ordered: Copy {
    /// `total_cmp`.
    fn order(&self, other: &Self) -> Ordering;
}

impl Ordered for f32 {
    fn order(&self, other: &Self) -> Ordering {
        self.total_cmp(other)
    }
}

impl Ordered for f64 {
    fn order(&self, other: &Self) -> Ordering {
        self.total_cmp(other)
    }
}

/// The value at position `rank`, from 0, of the sorted values; None beyond them. Linear time; reorders `values`.
pub fn ranked<T: Ordered>(values: &mut [T], rank: usize) -> Option<T> {
    (rank < values.len()).then(|| *values.select_nth_unstable_by(rank, T::order).1)
}

/// The upper median: the larger middle value of an even count. None without values. Linear time; reorders `values`.
pub fn upper_median<T: Ordered>(values: &mut [T]) -> Option<T> {
    ranked(values, values.len() / 2)
}

/// The median: the mean of the middle two of an even count. NaN without values. Linear time; reorders `values`.
pub fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let half = values.len() / 2;
    let is_odd = values.len() % 2 == 1;
    let (below, &mut middle, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    if is_odd { middle } else { 0.5 * (middle + below.iter().copied().fold(f64::NEG_INFINITY, f64::max)) }
}

/// The quantile at `share` from 0 to 1, linear between sorted neighbours. NaN without values. Reorders `values`.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    values.sort_unstable_by(f64::total_cmp);
    let place = share * (values.len() - 1) as f64;
    let (below, above) = (values[place.floor() as usize], values[place.ceil() as usize]);
    below + (place - place.floor()) * (above - below)
}

/// The median, and a robust standard deviation: the median absolute deviation times [`NORMAL_PER_MAD`].
pub fn robust(values: &[f64]) -> (f64, f64) {
    let centre = median(&mut values.to_vec());
    let mut distances: Vec<f64> = values.iter().map(|value| (value - centre).abs()).collect();
    (centre, NORMAL_PER_MAD * median(&mut distances))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_even_and_no_values() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&mut []).is_nan());
        assert_eq!(upper_median(&mut [4.0, 1.0, 2.0, 3.0]), Some(3.0));
        assert_eq!(upper_median::<f32>(&mut []), None);
    }

    #[test]
    fn ranks_follow_the_sorted_values() {
        let values = [5.0f32, -1.0, 3.0, 3.0, 0.0];
        let found: Vec<_> = (0..6).map(|rank| ranked(&mut values.clone(), rank)).collect();
        assert_eq!(found, [Some(-1.0), Some(0.0), Some(3.0), Some(3.0), Some(5.0), None]);
    }

    #[test]
    fn quantiles_lie_between_values() {
        let mut values = [4.0, 0.0, 2.0];
        let found = [0.0, 0.25, 0.5, 0.9, 1.0].map(|share| quantile(&mut values, share));
        assert_eq!(found, [0.0, 1.0, 2.0, 3.6, 4.0]);
        assert!(quantile(&mut [], 0.5).is_nan());
    }

    #[test]
    fn a_wild_value_does_not_move_the_robust_spread() {
        let (centre, spread) = robust(&[1.0, 2.0, 3.0, 4.0, 1e9]);
        assert_eq!((centre, spread), (3.0, NORMAL_PER_MAD));
    }
}
