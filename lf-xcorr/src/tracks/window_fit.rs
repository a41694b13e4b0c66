//! The displacement in a window, by least squares over the pairs inside it.
//!
//! Model: the displacement less the guess is a polynomial of the place, up to the second degree, plus a scatter that
//! the polynomial does not follow. The weight of a pair is the inverse of its full covariance plus the scatter's: near
//! the focal plane a particle is certain across a line and uncertain along it, and only the covariance knows the line.
//!
//! A window holds five to ten pairs, and the polynomial has ten terms of three components. So each coefficient but the
//! constant has a prior of mean zero, whose variance [`super::priors`] finds in the field itself: where the flow does
//! not bend, the terms vanish and add no uncertainty.
//!
//! Pairs that do not fit lose their weight by the probability that they are wrong, in a mixture with an even density.

use glam::{DMat3, DVec3};
use lf_core::linear;

/// Terms of a polynomial of the second degree.
pub(crate) const TERMS: usize = 10;
/// Coefficients: three components of each term.
pub(crate) const UNKNOWNS: usize = 3 * TERMS;

/// Constant: squared Mahalanobis distance at which a pair is as likely wrong as right. One pair of fifty is wrong, and
/// then lies anywhere in a gate of five standard deviations: 2 ln(49 x 33).
const EVEN_ODDS: f64 = 15.0;

/// The terms at a place in half windows from the centre.
pub(crate) fn basis(place: DVec3) -> [f64; TERMS] {
    let [x, y, z] = place.to_array();
    [1.0, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z]
}

/// Prior knowledge of a window: variances, mm².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Priors {
    /// Variance of each coefficient, about zero; the constant's is the square of a window's length.
    pub terms: [DVec3; TERMS],
    /// Variance of the displacements about the polynomial, beyond the covariances of the pairs.
    pub scatter: DVec3,
    /// Variance of the residuals over the one expected.
    pub misfit: f64,
}

/// A pair as one window sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub basis: [f64; TERMS],
    /// Displacement less the guess, mm.
    pub rest_mm: DVec3,
    pub covariance_mm2: DMat3,
    pub chance: f64,
}

/// The fit of a window.
pub(crate) struct WindowFit {
    /// Coefficients, mm; the first is the displacement at the centre less the guess.
    pub terms: [DVec3; TERMS],
    /// Weight of each sample, 0 to 1.
    pub weights: Vec<f64>,
    /// Inverse covariance of each sample with the scatter, 1 / mm².
    pub precisions: Vec<DMat3>,
    /// Cholesky factor of the normal equations.
    lower: Vec<f64>,
}

impl WindowFit {
    /// None without samples.
    pub fn new(samples: &[Sample], priors: &Priors) -> Option<Self> {
        // Constants: rounds end when weights change by less than this, or after this many.
        const STALL: f64 = 0.05;
        const ROUNDS: usize = 8;
        if samples.is_empty() {
            return None;
        }
        let scatter = DMat3::from_diagonal(priors.scatter);
        let precisions: Vec<DMat3> = samples.iter().map(|sample| (sample.covariance_mm2 + scatter).inverse()).collect();
        let mut weights: Vec<f64> = samples.iter().map(|sample| sample.chance).collect();
        let (mut terms, mut lower) = solve(samples, &precisions, &weights, priors)?;
        for _ in 1..ROUNDS {
            let weight = |(sample, precision): (&Sample, &DMat3)| {
                let distance2 = distance2(sample, precision, &terms) / priors.misfit;
                sample.chance / (1.0 + (0.5 * (distance2 - EVEN_ODDS)).exp())
            };
            let better: Vec<f64> = samples.iter().zip(&precisions).map(weight).collect();
            let change = better.iter().zip(&weights).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            weights = better;
            if change < STALL {
                break;
            }
            (terms, lower) = solve(samples, &precisions, &weights, priors)?;
        }
        Some(Self { terms, weights, precisions, lower })
    }

    /// Covariance of the displacement at the centre, mm².
    pub fn covariance_mm2(&self) -> DMat3 {
        let column = |n: usize| DVec3::from_slice(&linear::inverse_column(&self.lower, UNKNOWNS, n));
        DMat3::from_cols(column(0), column(1), column(2))
    }

    /// Covariance of all coefficients, by columns.
    pub fn covariances(&self) -> Vec<Vec<f64>> {
        (0..UNKNOWNS).map(|n| linear::inverse_column(&self.lower, UNKNOWNS, n)).collect()
    }
}

/// Displacement less the polynomial, mm.
pub(crate) fn residual_mm(sample: &Sample, terms: &[DVec3; TERMS]) -> DVec3 {
    sample.rest_mm - sample.basis.iter().zip(terms).map(|(value, term)| *value * *term).sum::<DVec3>()
}

/// Squared Mahalanobis distance of a sample from the polynomial.
pub(crate) fn distance2(sample: &Sample, precision: &DMat3, terms: &[DVec3; TERMS]) -> f64 {
    let residual = residual_mm(sample, terms);
    residual.dot(*precision * residual)
}

/// The coefficients under given weights. Unknown `3 t + c` is component c of term t.
fn solve(
    samples: &[Sample],
    precisions: &[DMat3],
    weights: &[f64],
    priors: &Priors,
) -> Option<([DVec3; TERMS], Vec<f64>)> {
    let (mut matrix, mut right) = (vec![0.0; UNKNOWNS * UNKNOWNS], [0.0; UNKNOWNS]);
    for ((sample, precision), weight) in samples.iter().zip(precisions).zip(weights) {
        let precision = *weight * *precision;
        let weighted = (precision * sample.rest_mm).to_array();
        let rows = precision.to_cols_array_2d();
        for (t, value) in sample.basis.iter().enumerate() {
            (0..3).for_each(|c| right[3 * t + c] += value * weighted[c]);
            for (c, row) in rows.iter().enumerate() {
                let line = &mut matrix[UNKNOWNS * (3 * t + c)..][..UNKNOWNS];
                for (s, other) in sample.basis[..=t].iter().enumerate() {
                    let product = value * other;
                    (0..3).for_each(|d| line[3 * s + d] += product * row[d]);
                }
            }
        }
    }
    for (t, variance) in priors.terms.iter().enumerate() {
        (0..3).for_each(|c| matrix[(UNKNOWNS + 1) * (3 * t + c)] += variance[c].recip());
    }
    linear::cholesky(&mut matrix, UNKNOWNS, 0.0)?;
    linear::solve(&matrix, &mut right);
    Some((std::array::from_fn(|t| DVec3::from_slice(&right[3 * t..])), matrix))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn priors(gradient: f64) -> Priors {
        let mut terms = [DVec3::splat(gradient); TERMS];
        terms[0] = DVec3::splat(1.0);
        Priors { terms, scatter: DVec3::splat(1e-14), misfit: 1.0 }
    }

    fn sample(place: DVec3, rest_mm: DVec3, variance: DVec3) -> Sample {
        Sample { basis: basis(place), rest_mm, covariance_mm2: DMat3::from_diagonal(variance), chance: 1.0 }
    }

    /// By hand: displacements 0 and 6 with variances 1 and 2 (times 1e-6) have the mean 2 and the variance 2 / 3.
    #[test]
    fn two_pairs_by_hand() {
        let pairs = [(0.0, 1e-6), (6e-3, 2e-6)]
            .map(|(shift, variance)| sample(DVec3::ZERO, shift * DVec3::X, variance * DVec3::ONE));
        let fit = WindowFit::new(&pairs, &priors(1e-14)).unwrap();
        assert!((fit.terms[0] - 2e-3 * DVec3::X).abs().max_element() < 1e-5, "{:?}", fit.terms[0]);
        assert!((fit.covariance_mm2().diagonal() - 2e-6 / 3.0).abs().max_element() < 1e-10);
        assert!(WindowFit::new(&[], &priors(1e-14)).is_none());
    }

    /// Each of two particles is certain across its own line only. Together they determine the whole displacement.
    #[test]
    fn lines_that_cross_give_a_point() {
        let wanted = DVec3::new(1e-3, 2e-3, -5e-3);
        let line = |direction: DVec3| {
            let along = direction.normalize();
            let outer = DMat3::from_cols(along * along.x, along * along.y, along * along.z);
            Sample {
                covariance_mm2: DMat3::from_diagonal(DVec3::splat(1e-10)) + 0.01 * outer,
                ..sample(DVec3::ZERO, wanted + 0.08 * along, DVec3::ONE)
            }
        };
        let lines = [line(DVec3::new(0.3, 0.0, 1.0)), line(DVec3::new(-0.2, 0.0, 1.0))];
        let fit = WindowFit::new(&lines, &priors(1e-14)).unwrap();
        assert!((fit.terms[0] - wanted).length() < 3e-4, "{:?}", fit.terms[0]);
        assert!(fit.covariance_mm2().diagonal().max_element() < 1e-8);
    }

    #[test]
    fn a_false_pair_loses_its_weight() {
        let places = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z];
        let mut pairs: Vec<Sample> = places.map(|place| sample(place, DVec3::Y * 1e-3, DVec3::splat(1e-8))).to_vec();
        pairs.push(sample(DVec3::ZERO, DVec3::new(8e-4, 1e-3, 0.0), DVec3::splat(1e-8)));
        let fit = WindowFit::new(&pairs, &priors(1e-14)).unwrap();
        assert!((fit.terms[0] - DVec3::Y * 1e-3).length() < 1e-6, "{:?}", fit.terms[0]);
        assert!(fit.weights[5] < 1e-3 && fit.weights[..5].iter().all(|weight| *weight > 0.9), "{:?}", fit.weights);
    }

    #[test]
    fn a_prior_decides_whether_a_gradient_is_followed() {
        let places = [0.9, 0.5, 0.8, 0.2].map(|x| x * DVec3::X);
        let pairs = places.map(|place| sample(place, 2e-3 * place, DVec3::splat(1e-6)));
        let centre = |gradient: f64| WindowFit::new(&pairs, &priors(gradient)).unwrap().terms[0].x;
        // The mean of the places is 0.6.
        assert!((centre(1e-14) - 1.2e-3).abs() < 1e-6 && centre(1.0).abs() < 1e-5, "{} {}", centre(1e-14), centre(1.0));
    }
}
