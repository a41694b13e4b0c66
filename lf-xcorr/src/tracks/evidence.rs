//! Sums over windows that determine the variances of the priors.
//!
//! Equation, after MacKay (Neural Computation, 1992): the variance of a coefficient is the sum of its squares over
//! windows, divided by the effective number of windows that the pairs determine, `1 - posterior variance / prior
//! variance` each. The variance of the scatter follows in the same way from sums over pairs. Repeating this finds the
//! variances that make the measured displacements most likely.

use super::window_fit::{Priors, Sample, TERMS, UNKNOWNS, WindowFit, distance2, residual_mm};
use glam::{DMat3, DVec3};

/// Numbers in a set of priors: a variance for each coefficient, then the scatter's three, then the misfit.
pub(crate) const NUMBERS: usize = UNKNOWNS + 4;

impl Priors {
    pub fn to_numbers(self) -> [f64; NUMBERS] {
        let mut numbers = [self.misfit; NUMBERS];
        for (t, variance) in self.terms.iter().chain([&self.scatter]).enumerate() {
            numbers[3 * t..3 * t + 3].copy_from_slice(&variance.to_array());
        }
        numbers
    }

    pub fn of_numbers(numbers: &[f64; NUMBERS]) -> Self {
        let triple = |t: usize| DVec3::from_slice(&numbers[3 * t..]);
        Self { terms: std::array::from_fn(triple), scatter: triple(TERMS), misfit: numbers[NUMBERS - 1] }
    }
}

/// Numerators and denominators of the numbers of a set of priors; both are 0 where nothing is known.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evidence {
    pub above: [f64; NUMBERS],
    pub below: [f64; NUMBERS],
}

impl Default for Evidence {
    fn default() -> Self {
        Self { above: [0.0; NUMBERS], below: [0.0; NUMBERS] }
    }
}

impl Evidence {
    /// The evidence of one window.
    pub fn new(samples: &[Sample], fit: &WindowFit, priors: &Priors) -> Self {
        let mut evidence = Self::default();
        let inverse = fit.covariances();
        for t in 1..TERMS {
            for c in 0..3 {
                let n = 3 * t + c;
                evidence.above[n] = fit.terms[t][c].powi(2);
                evidence.below[n] = (1.0 - inverse[n][n] / priors.terms[t][c]).max(0.0);
            }
        }
        for ((sample, precision), weight) in samples.iter().zip(&fit.precisions).zip(&fit.weights) {
            let rest = *precision * residual_mm(sample, &fit.terms);
            let uncertain = of_prediction(sample, &inverse);
            let inner = *precision * uncertain * *precision;
            for c in 0..3 {
                let (variance, n) = (priors.scatter[c], UNKNOWNS + c);
                evidence.above[n] += weight * (variance * rest[c]).powi(2);
                evidence.below[n] += weight * variance * (precision.col(c)[c] - inner.col(c)[c]).max(0.0);
            }
            let product = *precision * uncertain;
            let trace = (0..3).map(|c| product.col(c)[c]).sum::<f64>();
            evidence.above[NUMBERS - 1] += weight * (distance2(sample, precision, &fit.terms) + trace);
            evidence.below[NUMBERS - 1] += 3.0 * weight;
        }
        evidence
    }

    pub fn add(&mut self, other: &Self, weight: f64) {
        for n in 0..NUMBERS {
            self.above[n] += weight * other.above[n];
            self.below[n] += weight * other.below[n];
        }
    }
}

/// Covariance of the polynomial at a sample, mm².
fn of_prediction(sample: &Sample, inverse: &[Vec<f64>]) -> DMat3 {
    let mut sum = [[0.0; 3]; 3];
    for (t, value) in sample.basis.iter().enumerate() {
        for (c, row) in sum.iter_mut().enumerate() {
            let column = &inverse[3 * t + c];
            for (s, other) in sample.basis.iter().enumerate() {
                (0..3).for_each(|d| row[d] += value * other * column[3 * s + d]);
            }
        }
    }
    DMat3::from_cols_array_2d(&sum)
}
