//! The roughness of values on a grid: the sum of squares of their second differences along each axis.
//!
//! A small share of the squares of first differences keeps values near each other in long gaps. Differences are per
//! step, since windows cover about as many steps along every axis.

/// Constant: share of first differences. It matters only more than about ten steps from the nearest measured vector.
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

    /// Entries (i, i), (i, i + 1) and (i, i + 2) of the matrix along an axis of `count` values.
    pub fn bands(count: usize) -> Vec<[f64; 3]> {
        let mut bands = vec![[0.0; 3]; count];
        for i in 1..count {
            bands[i - 1][1] -= SLOPE_SHARE;
            (bands[i - 1][0], bands[i][0]) = (bands[i - 1][0] + SLOPE_SHARE, bands[i][0] + SLOPE_SHARE);
        }
        for i in 2..count {
            bands[i - 2][2] += 1.0;
            (bands[i - 2][1], bands[i - 1][1]) = (bands[i - 2][1] - 2.0, bands[i - 1][1] - 2.0);
            [(i - 2, 1.0), (i - 1, 4.0), (i, 1.0)].iter().for_each(|(at, square)| bands[*at][0] += square);
        }
        bands
    }

    /// Adds `factor` times the gradient of half the roughness to `out`.
    pub fn add(&self, factor: f64, values: &[f64], out: &mut [f64]) {
        for axis in 0..3 {
            let (count, stride): (usize, usize) = (self.shape[axis], self.shape[..axis].iter().product());
            let bands = Self::bands(count);
            for shift in 0..count.min(3) {
                // Each entry couples a place with the one `shift` further on, and back.
                let ahead = shift * stride;
                let entries: Vec<f64> = bands[..count - shift].iter().map(|band| factor * band[shift]).collect();
                let lines = values.chunks_exact(count * stride).zip(out.chunks_exact_mut(count * stride));
                for (values, out) in lines {
                    couple(&entries, stride, &values[ahead..], out);
                    if shift > 0 {
                        couple(&entries, stride, values, &mut out[ahead..]);
                    }
                }
            }
        }
    }

    /// Diagonal of the matrix that [`Roughness::add`] applies.
    pub fn diagonal(&self) -> Vec<f64> {
        let [nx, ny, nz] = self.shape;
        let bands = self.shape.map(Self::bands);
        let at = |i: usize| bands[0][i % nx][0] + bands[1][i / nx % ny][0] + bands[2][i / nx / ny][0];
        (0..nx * ny * nz).map(at).collect()
    }
}

/// Adds `values` times their entries to `out`; each entry is that of `stride` values.
fn couple(entries: &[f64], stride: usize, values: &[f64], out: &mut [f64]) {
    if stride == 1 {
        out.iter_mut().zip(entries.iter().zip(values)).for_each(|(out, (entry, value))| *out += entry * value);
        return;
    }
    let rows = values.chunks_exact(stride).zip(out.chunks_exact_mut(stride));
    for (entry, (values, out)) in entries.iter().zip(rows) {
        out.iter_mut().zip(values).for_each(|(out, value)| *out += entry * value);
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
