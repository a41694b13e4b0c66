//! The covariance of a particle: a block of the inverse of the Fisher matrix of the particle and its neighbours.

use super::normal::Normal;
use crate::model::particle_image::UNKNOWNS;
use lf_core::linear::{cholesky_above, inverse_column};

/// Knowledge before the image is seen: standard deviations in pixels of the focal plane and of the logarithm of the
/// light. It keeps an uncertainty finite where no pixel determines the unknown.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Prior(pub(crate) [f64; UNKNOWNS]);

/// Largest variance over that of the prior: a larger one is an error of rounding.
const MOST: f64 = 1.001;
/// The diagonal is first raised by this share of itself: rounding in 32 bits.
const RAISE: f64 = 1e-7;

/// The covariance of the unknowns of the first of `chosen`, the others of them free too, in pixels of the focal plane
/// and in shares of the light.
pub(crate) fn covariance(normal: &Normal, chosen: &[usize], prior: Prior) -> [[f64; UNKNOWNS]; UNKNOWNS] {
    first_of_inverse(&normal.dense(chosen), UNKNOWNS * chosen.len(), prior)
}

/// The block of the first particle in the inverse of a Fisher matrix and the prior. Where pixels do not
/// distinguish many particles, sums in 32 bits can hold more information than is possible, and the inverse is no
/// covariance. Then the diagonal is raised step by step until it is one.
fn first_of_inverse(fisher: &[f64], size: usize, prior: Prior) -> [[f64; UNKNOWNS]; UNKNOWNS] {
    let least = |n: usize| prior.0[n % UNKNOWNS].powi(-2);
    let mut raise = 0.0;
    loop {
        let mut lower = fisher.to_vec();
        for n in 0..size {
            lower[n * size + n] += least(n) + raise * fisher[n * size + n];
        }
        // The image can only add to the prior.
        cholesky_above(&mut lower, size, |n, _| least(n));
        let found: [[f64; UNKNOWNS]; UNKNOWNS] = std::array::from_fn(|k| {
            let column = inverse_column(&lower, size, k);
            std::array::from_fn(|n| column[n])
        });
        let can_be =
            |k: usize| found[k][k] > 0.0 && found[k][k] < MOST / least(k) && found[k].iter().all(|v| v.is_finite());
        if raise >= 1.0 || (0..UNKNOWNS).all(can_be) {
            return found;
        }
        raise = (10.0 * raise).max(RAISE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two unknowns that pixels do not distinguish, and rounded sums with a little more information than is possible.
    #[test]
    fn a_pivot_below_the_prior_does_not_spread() {
        let matrix = [1e4, 1e4 + 0.04, 500.0, 1e4 + 0.04, 1e4, 500.03, 500.0, 500.03, 1e4];
        let mut lower = matrix;
        cholesky_above(&mut lower, 3, |_, _| 0.005);
        for row in 0..3 {
            for column in 0..=row {
                let product: f64 = (0..=column).map(|k| lower[3 * row + k] * lower[3 * column + k]).sum();
                assert!((product - matrix[3 * row + column]).abs() < 0.3, "{row} {column}: {product}");
            }
        }
    }

    /// Twelve bright particles with three patterns of pixels, and sums in 32 bits.
    #[test]
    fn particles_that_no_pixel_distinguishes_have_finite_uncertainties() {
        let (particles, prior) = (12, Prior([14.0, 14.0, 2000.0, 1.0]));
        let size = UNKNOWNS * particles;
        let mut fisher = vec![0.0; size * size];
        for row in 0..size {
            for column in 0..size {
                let pattern = |n: usize, k: usize| 1e4 * (1.3 * (n + 1) as f64 * (k + 1) as f64).sin();
                let sum: f64 = (0..3).map(|k| pattern(row.max(column), k) * pattern(row.min(column), k)).sum();
                fisher[row * size + column] = f64::from(sum as f32);
            }
        }
        let found = first_of_inverse(&fisher, size, prior);
        for n in 0..UNKNOWNS {
            assert!(found[n][n] > 0.0 && found[n][n] <= 1.001 * prior.0[n].powi(2), "{n}: {}", found[n][n]);
            for k in 0..UNKNOWNS {
                let bound = (found[n][n] * found[k][k]).sqrt();
                assert!(found[n][k].abs() <= 1.001 * bound, "{n} {k}: {} of {bound}", found[n][k]);
            }
        }
    }
}
