//! Momentum after Nesterov (1983) in the logarithm of the strengths. It restarts when the misfit rises (O'Donoghue &
//! Candes 2015).

use super::problem::GREATEST_STRENGTH;
use rayon::prelude::*;

/// Largest factor by which momentum changes a strength.
const MOST_FACTOR: f32 = 8.0;

pub(super) struct Momentum {
    /// Strengths after the sweep before.
    pub(super) before: Vec<f32>,
    t: f64,
    misfit: f64,
}

impl Momentum {
    pub(super) fn new(strengths: &[f32]) -> Self {
        Self { before: strengths.to_vec(), t: 1.0, misfit: f64::INFINITY }
    }

    /// Extrapolates the strengths along the sweep that ends: E (E / E_before)^beta with beta = (t - 1) / t'.
    pub(super) fn carry(&mut self, strengths: &mut [f32], misfit: f64) {
        if misfit > self.misfit {
            self.t = 1.0;
        }
        self.misfit = misfit;
        let next = 0.5 * (1.0 + (1.0 + 4.0 * self.t * self.t).sqrt());
        let beta = ((self.t - 1.0) / next) as f32;
        self.t = next;
        strengths.par_iter_mut().zip(&mut self.before).with_min_len(4096).for_each(|(strength, before)| {
            let now = *strength;
            if beta > 0.0 && now > 0.0 && *before > 0.0 {
                let carried = (now / *before).powf(beta).clamp(1.0 / MOST_FACTOR, MOST_FACTOR);
                *strength = (now * carried).min(GREATEST_STRENGTH);
            }
            *before = now;
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// t = 1, 1.618, 2.194 gives beta = 0 after the first sweep and 0.618 / 2.194 = 0.2817 after the second.
    #[test]
    fn the_second_sweep_extrapolates_the_first() {
        let mut momentum = Momentum::new(&[1.0, 4.0, 0.0]);
        let mut strengths = [2.0, 2.0, 0.0];
        momentum.carry(&mut strengths, 0.5);
        assert_eq!(strengths, [2.0, 2.0, 0.0]);
        strengths = [4.0, 1.0, 0.0];
        momentum.carry(&mut strengths, 0.4);
        assert!((strengths[0] - 4.0 * 2f32.powf(0.2817)).abs() < 1e-3, "{strengths:?}");
        assert!((strengths[1] - 0.5f32.powf(0.2817)).abs() < 1e-3, "{strengths:?}");
        assert_eq!(momentum.before, [4.0, 1.0, 0.0]);
        // A rising misfit resets the momentum.
        let mut strengths = [8.0, 1.0, 0.0];
        momentum.carry(&mut strengths, 0.41);
        assert_eq!(strengths, [8.0, 1.0, 0.0]);
    }
}
