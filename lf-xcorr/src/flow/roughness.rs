//! The roughness of values on a grid: the sum of squares of their second differences along each axis.
//!
//! A small share of the squares of first differences holds values near each other where nothing is measured for long.
//! Differences are taken in steps, since windows cover about as many steps along every axis.

/// Constant: share of first differences. It matters only beyond some ten steps from the nearest measured vector.
const SLOPE_SHARE: f64 = 1e-4;

/// Roughness of values on a grid of this shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct Roughness {
    shape: [usize; 3],
}

impl Roughness {
    pub fn new(shape: [usize; 3]) -> Self {
        Self { shape }
    }

    /// Adds `factor` times the gradient of half the roughness to `out`.
    pub fn add(&self, factor: f64, values: &[f64], out: &mut [f64]) {
        for axis in 0..3 {
            let (count, stride): (usize, usize) = (self.shape[axis], self.shape[..axis].iter().product());
            for first in (0..values.len()).step_by(count * stride) {
                for at in 0..count.saturating_sub(1) {
                    let row = first + at * stride;
                    for i in row..row + stride {
                        let slope = factor * SLOPE_SHARE * (values[i + stride] - values[i]);
                        out[i + stride] += slope;
                        out[i] -= slope;
                    }
                    if at + 2 < count {
                        for i in row..row + stride {
                            let bend = values[i] - 2.0 * values[i + stride] + values[i + 2 * stride];
                            let bend = factor * bend;
                            out[i] += bend;
                            out[i + stride] -= 2.0 * bend;
                            out[i + 2 * stride] += bend;
                        }
                    }
                }
            }
        }
    }

    /// Diagonal of the matrix that [`Roughness::add`] applies.
    pub fn diagonal(&self) -> Vec<f64> {
        let along = |axis: usize, at: usize| {
            let count = self.shape[axis];
            let bends = [(0, 1.0), (1, 4.0), (2, 1.0)];
            let of_bends = bends.iter().filter(|(back, _)| at >= *back && at - back + 2 < count);
            let slopes = usize::from(at > 0) + usize::from(at + 1 < count);
            of_bends.map(|(_, square)| square).sum::<f64>() + SLOPE_SHARE * slopes as f64
        };
        let [nx, ny, nz] = self.shape;
        let at = |i: usize| along(0, i % nx) + along(1, i / nx % ny) + along(2, i / nx / ny);
        (0..nx * ny * nz).map(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_not_rough_but_for_its_slope_and_the_diagonal_is_that_of_unit_values() {
        let roughness = Roughness::new([5, 4, 3]);
        let plane: Vec<f64> = (0..60).map(|i| 0.5 * f64::from(i % 5) - f64::from(i / 20)).collect();
        let mut out = vec![0.0; 60];
        roughness.add(1.0, &plane, &mut out);
        let energy: f64 = plane.iter().zip(&out).map(|(a, b)| a * b).sum();
        // 48 slopes of 0.5 along x, 40 of -1 along z.
        assert!((energy - SLOPE_SHARE * (48.0 * 0.25 + 40.0)).abs() < 1e-12, "{energy}");
        for (i, wanted) in roughness.diagonal().into_iter().enumerate() {
            let mut unit = vec![0.0; 60];
            unit[i] = 1.0;
            out.fill(0.0);
            roughness.add(1.0, &unit, &mut out);
            assert!((out[i] - wanted).abs() < 1e-12, "{i}");
        }
    }
}
