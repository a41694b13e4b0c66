//! How uncertain a particle is: the inverse of the Fisher matrix of it and its neighbours.

use super::buffers::Buffers;
use super::image::{SpotImage, UNKNOWNS};
use super::joint::Setting;
use super::normal::{cholesky, solve};
use super::window::Window;

/// Knowledge before the image is seen: standard deviations in pixels of the focal plane and of the logarithm of the
/// light. It keeps the uncertainty of what no pixel tells finite.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prior(pub(super) [f64; UNKNOWNS]);

impl Setting<'_> {
    /// The covariance of the unknowns of the first of `images`, the others free too, in pixels of the focal plane and
    /// in shares of the light. The window holds the light of all particles.
    pub(super) fn covariance(
        &self,
        window: &Window,
        images: &[&SpotImage],
        prior: Prior,
        buffers: &mut Buffers,
    ) -> [[f64; UNKNOWNS]; UNKNOWNS] {
        buffers.fit(window.seen.len());
        let size = UNKNOWNS * images.len();
        let mut fisher = vec![0.0; size * size];
        for (a, image) in images.iter().enumerate() {
            // The weighed derivatives of one particle, pixel by pixel.
            let touched = &mut buffers.touched;
            let field = &mut buffers.field;
            field.resize(window.seen.len(), [0.0; UNKNOWNS]);
            image.pixels(window.columns, |n, pixel| {
                let seen = window.seen[n];
                let weight = if seen.is_nan() { 0.0 } else { 1.0 / self.noise.variance(window.light[n]) };
                (0..UNKNOWNS).for_each(|k| field[n][k] += weight * pixel[k]);
                touched.push(n as u32);
            });
            for (b, other) in images.iter().enumerate().skip(a) {
                let mut block = [[0f64; UNKNOWNS]; UNKNOWNS];
                other.pixels(window.columns, |n, pixel| {
                    let weighed = field[n];
                    if weighed[3] != 0.0 {
                        for (row, weighed) in block.iter_mut().zip(weighed) {
                            (0..UNKNOWNS).for_each(|k| row[k] += f64::from(weighed * pixel[k]));
                        }
                    }
                });
                for (i, row) in block.iter().enumerate() {
                    for (k, value) in row.iter().enumerate() {
                        fisher[(a * UNKNOWNS + i) * size + b * UNKNOWNS + k] = *value;
                        fisher[(b * UNKNOWNS + k) * size + a * UNKNOWNS + i] = *value;
                    }
                }
            }
            touched.drain(..).for_each(|n| field[n as usize] = [0.0; UNKNOWNS]);
        }
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
}
