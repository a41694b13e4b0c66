//! How uncertain a particle is: the inverse of the Fisher matrix of it and its neighbours.

use super::image::UNKNOWNS;
use super::normal::{Normal, cholesky, solve};

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
    cholesky(&mut fisher, size);
    std::array::from_fn(|k| {
        let mut column = vec![0.0; size];
        column[k] = 1.0;
        solve(&fisher, size, &mut column);
        std::array::from_fn(|n| column[n])
    })
}
