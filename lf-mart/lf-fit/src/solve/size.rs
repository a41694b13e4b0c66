//! The size of a particle, where sizes differ: its equation, and the spread of the sizes of all particles.

use super::covariance::Prior;
use super::normal::Normal;
use crate::model::particle_image::UNKNOWNS;
use lf_core::linear::{cholesky_above, solve};
use lf_core::statistics::upper_median;

/// Sums over the pixels of a particle, per unit of the logarithm of its size.
#[derive(Debug, Clone)]
pub(crate) struct SizeSums {
    /// Slopes by the size, times weighted differences of the image.
    pub(crate) right: f64,
    /// Squares of the slopes, times weights.
    pub(crate) square: f64,
    /// Slopes times derivatives by place and light, times weights: of the particle and then of its neighbours.
    pub(crate) mixed: Vec<f64>,
}

/// The equation of a particle's size, from which places and lights are eliminated, those of its neighbours too.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SizeEquation {
    right: f64,
    information: f64,
    /// The step of place and light without a step of the size, and the part that such a step takes away.
    own: [f64; UNKNOWNS],
    by_size: [f64; UNKNOWNS],
}

/// Spread of the logarithms of the particles' sizes over that of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SizeSpread {
    middle: f64,
    variance: f64,
}

/// Sizes that spread by less than this share are taken as one.
const LEAST_SPREAD: f64 = 0.03;
/// A spread stands out from none by this number of its own standard deviations.
const SURE: f64 = 4.0;
/// Sizes that are less certain than this show no spread.
const MOST_STD: f64 = 0.15;
/// Median of chi squared with one degree of freedom. The median of n such numbers has the second number over the root
/// of n as its standard deviation.
const MEDIAN: f64 = 0.4549;
const MEDIAN_STD: f64 = 1.064;
/// Longest step, and largest logarithm.
const STEP: f64 = 0.3;
const MOST: f64 = 1.1;
/// Halvings of the interval of a variance.
const HALVINGS: usize = 40;

impl SizeEquation {
    /// Eliminates the particles `chosen`, the first of which has the size.
    pub(crate) fn new(sums: SizeSums, normal: &Normal, chosen: &[usize], prior: Prior) -> Self {
        let SizeSums { right, square, mixed } = sums;
        let size = mixed.len();
        let mut lower = normal.dense(chosen);
        let least = |n: usize| prior.0[n % UNKNOWNS].powi(-2);
        (0..size).for_each(|n| lower[n * size + n] += least(n));
        cholesky_above(&mut lower, size, |n, _| least(n));
        let mut own: Vec<f64> = chosen.iter().flat_map(|n| normal.gradient[*n]).collect();
        let mut by_size = mixed.clone();
        solve(&lower, &mut own);
        solve(&lower, &mut by_size);
        let dot = |other: &[f64]| -> f64 { mixed.iter().zip(other).map(|(a, b)| a * b).sum() };
        let first = |all: &[f64]| std::array::from_fn(|k| all[k]);
        Self {
            right: right - dot(&own),
            information: (square - dot(&by_size)).max(0.0),
            own: first(&own),
            by_size: first(&by_size),
        }
    }

    /// The likeliest size by its own light, and its variance. None if its light hardly shows it.
    pub(crate) fn alone(&self, log_size: f64, misfit: f64) -> Option<(f64, f64)> {
        let is_seen = self.information * MOST_STD * MOST_STD > misfit;
        is_seen.then(|| (log_size + self.right / self.information, misfit / self.information))
    }

    /// The likeliest size among others that spread, the standard uncertainty, and the step of place and light with it.
    pub(crate) fn among(&self, spread: SizeSpread, log_size: f64, misfit: f64) -> (f64, f64, [f64; UNKNOWNS]) {
        let information = self.information / misfit + 1.0 / spread.variance;
        let pull = (spread.middle - log_size) / spread.variance;
        let step = (self.right / misfit + pull) / information;
        let next = (log_size + step.clamp(-STEP, STEP)).clamp(-MOST, MOST);
        let own = std::array::from_fn(|k| self.own[k] - (next - log_size) * self.by_size[k]);
        (next, information.sqrt().recip(), own)
    }

    /// The covariance of place and light that comes from the size.
    pub(crate) fn covariance(&self, spread: SizeSpread) -> [[f64; UNKNOWNS]; UNKNOWNS] {
        let variance = 1.0 / (self.information + 1.0 / spread.variance);
        self.by_size.map(|row| self.by_size.map(|column| variance * row * column))
    }
}

impl SizeSpread {
    /// The spread of sizes of which each has its variance. None if they may be one size. It is such that the median of
    /// squared distances over variances is as it should be: sizes of particles that overlap are far off.
    pub(crate) fn of(sizes: &[(f64, f64)]) -> Option<Self> {
        let middle = upper_median(&mut sizes.iter().map(|(size, _)| *size).collect::<Vec<f64>>())?;
        let median = |more: f64| {
            let squares = sizes.iter().map(|(size, variance)| (size - middle).powi(2) / (variance + more));
            upper_median(&mut squares.collect::<Vec<f64>>()).unwrap_or(0.0)
        };
        let least = LEAST_SPREAD * LEAST_SPREAD;
        if median(least) < MEDIAN + SURE * MEDIAN_STD / (sizes.len() as f64).sqrt() {
            return None;
        }
        let (mut low, mut high) = (least, MOST * MOST);
        for _ in 0..HALVINGS {
            let half = 0.5 * (low + high);
            if median(half) > MEDIAN { low = half } else { high = half }
        }
        Some(Self { middle, variance: high })
    }

    /// Middle of the logarithms, no farther than a step. With a wrong model they can lie anywhere.
    pub(crate) fn middle(&self) -> f64 {
        self.middle.clamp(-STEP, STEP)
    }

    /// Standard deviation of the logarithms.
    pub(crate) fn std(&self) -> f64 {
        self.variance.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes on the quantiles of a Gaussian, each known to 0.1; every tenth is far off.
    fn sizes(spread: f64) -> Vec<(f64, f64)> {
        let total = (spread * spread + 0.01).sqrt();
        let of = |n: usize| {
            let quantile = (n as f64 + 0.5) / 200.0;
            // A logistic curve is near the Gaussian's here.
            let z = (quantile / (1.0 - quantile)).ln() / 1.63;
            (0.05 + total * z + if n % 20 == 3 { 2.0 } else { 0.0 }, 0.01)
        };
        (0..200).map(of).collect()
    }

    #[test]
    fn a_spread_is_found_beside_errors_and_none_where_there_is_none() {
        assert_eq!(SizeSpread::of(&sizes(0.0)), None);
        assert_eq!(SizeSpread::of(&[]), None);
        for spread in [0.15, 0.3] {
            let found = SizeSpread::of(&sizes(spread)).unwrap();
            assert!((found.std() / spread - 1.0).abs() < 0.15, "{spread}: {found:?}");
            assert!((found.middle - 0.05).abs() < 0.06, "{found:?}");
        }
    }
}
