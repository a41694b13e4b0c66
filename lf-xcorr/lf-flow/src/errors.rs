//! Errors like those of a measured field, drawn at random.
//!
//! Windows that overlap share particles, and so their errors. Two vectors whose windows share a fraction f of their
//! length along an axis have errors of correlation f: the moving mean of white noise over a window has it.

use lf_core::VectorGrid;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// How the errors of neighbouring vectors are correlated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correlated {
    shape: [usize; 3],
    /// Distance, in vectors along x, y, z, to the next vector that shares no data.
    pub width: [usize; 3],
}

impl Correlated {
    pub fn new(layout: &VectorGrid) -> Self {
        let covered =
            |axis: usize| (layout.window_in_spacings(axis).round() as usize).clamp(1, layout.shape[axis].max(1));
        Self { shape: layout.shape, width: [0, 1, 2].map(covered) }
    }

    /// Correlation of the errors of two vectors `steps` apart along an axis.
    pub fn between(&self, axis: usize, steps: usize) -> f64 {
        (1.0 - steps as f64 / self.width[axis] as f64).max(0.0)
    }

    /// Errors of standard deviation 1 at all vectors. Equal numbers give equal errors.
    pub fn draw(&self, number: u64) -> Vec<f64> {
        let mut random = Pcg64Mcg::seed_from_u64(number);
        let mut shape = [0, 1, 2].map(|axis| self.shape[axis] + self.width[axis] - 1);
        let mut values: Vec<f64> =
            (0..shape.iter().product::<usize>()).map(|_| StandardNormal.sample(&mut random)).collect();
        for axis in 0..3 {
            values = moving_sum(&values, shape, axis, self.width[axis]);
            shape[axis] = self.shape[axis];
        }
        values
    }
}

/// Sums over `width` neighbours along an axis, over the root of `width`; the axis becomes `width - 1` shorter.
fn moving_sum(values: &[f64], shape: [usize; 3], axis: usize, width: usize) -> Vec<f64> {
    let stride: usize = shape[..axis].iter().product();
    let (count, scale) = (shape[axis] + 1 - width, 1.0 / (width as f64).sqrt());
    let blocks = values.len() / (stride * shape[axis]);
    let mut out = Vec::with_capacity(blocks * count * stride);
    for block in 0..blocks {
        let first = block * stride * shape[axis];
        for i in (0..count * stride).map(|i| first + i) {
            out.push(scale * (0..width).map(|n| values[i + n * stride]).sum::<f64>());
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_unit_variance_and_the_correlation_of_their_overlap() {
        let layout = VectorGrid {
            shape: [40, 36, 30],
            spacing_mm: [0.5, 1.0, 2.0],
            voxel_mm: [0.125, 1.0, 1.0],
            window: [16, 1, 4],
            ..VectorGrid::default()
        };
        let errors = Correlated::new(&layout);
        assert_eq!(errors.width, [4, 1, 2]);
        let found = errors.draw(3);
        assert_eq!((found.len(), found == errors.draw(3), found == errors.draw(4)), (40 * 36 * 30, true, false));
        let mean = |steps: usize, axis: usize| {
            let products =
                (0..found.len()).filter_map(|i| Some(found[i] * found[layout.neighbour(i, axis, steps as isize)?]));
            let all: Vec<f64> = products.collect();
            all.iter().sum::<f64>() / all.len() as f64
        };
        for axis in 0..3 {
            for steps in 0..5 {
                let wanted = errors.between(axis, steps);
                assert!((mean(steps, axis) - wanted).abs() < 0.06, "{axis} {steps}: {}", mean(steps, axis));
            }
        }
    }
}
