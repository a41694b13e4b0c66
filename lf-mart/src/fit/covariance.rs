//! How uncertain a particle is: the inverse of the Fisher matrix of it and its neighbours.

use super::image::UNKNOWNS;
use super::normal::{Normal, cholesky_above, solve};

/// Knowledge before the image is seen: standard deviations in pixels of the focal plane and of the logarithm of the
/// light. It keeps the uncertainty of what no pixel tells finite.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prior(pub(super) [f64; UNKNOWNS]);

/// The covariance of the unknowns of the first of `chosen`, the others of them free too, in pixels of the focal plane
/// and in shares of the light.
pub(super) fn covariance(normal: &Normal, chosen: &[usize], prior: Prior) -> [[f64; UNKNOWNS]; UNKNOWNS] {
    let size = UNKNOWNS * chosen.len();
    let mut fisher = normal.dense(chosen);
    for n in 0..size {
        fisher[n * size + n] += prior.0[n % UNKNOWNS].powi(-2);
    }
    // The image can only add to the prior.
    cholesky_above(&mut fisher, size, |n, _| prior.0[n % UNKNOWNS].powi(-2));
    std::array::from_fn(|k| {
        let mut column = vec![0.0; size];
        column[k] = 1.0;
        solve(&fisher, size, &mut column);
        std::array::from_fn(|n| column[n])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two unknowns that pixels do not tell apart, and rounded sums that say a little more than is possible.
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
}
