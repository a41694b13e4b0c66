//! First differences along the axes of a grid, and their transposes.
//!
//! Convention: at place i of n along an axis the slope is `(v[i + 1] - v[i - 1]) / (2 h)`; at the ends it is the
//! difference of the last two values over h.

use lf_core::VectorGrid;

/// The slopes of values on a grid of vectors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slopes {
    shape: [usize; 3],
    spacing: [f64; 3],
}

/// The two places along an axis whose difference is the slope at place `at` of `count`.
pub(super) fn ends(at: usize, count: usize) -> [usize; 2] {
    [at.saturating_sub(1), (at + 1).min(count - 1)]
}

impl Slopes {
    pub fn new(layout: &VectorGrid) -> Self {
        Self { shape: layout.shape, spacing: layout.spacing_mm }
    }

    pub fn shape(&self) -> [usize; 3] {
        self.shape
    }

    /// Distance in memory between neighbours along an axis.
    pub fn stride(&self, axis: usize) -> usize {
        self.shape[..axis].iter().product()
    }

    /// 1 / distance between the two values that make the slope at a place along an axis.
    pub fn factor(&self, axis: usize, at: usize) -> f64 {
        let [low, high] = ends(at, self.shape[axis]);
        1.0 / ((high - low) as f64 * self.spacing[axis])
    }

    /// Calls `row(base, low, high, factor)` for every row of neighbours across an axis: first indices of a row of
    /// slopes and of the two rows of values that they are made of.
    fn rows(&self, axis: usize, mut row: impl FnMut(usize, usize, usize, f64)) {
        let (count, stride) = (self.shape[axis], self.stride(axis));
        let blocks = self.shape[axis + 1..].iter().product::<usize>();
        for block in 0..blocks {
            let first = block * count * stride;
            for at in 0..count {
                let [low, high] = ends(at, count).map(|end| first + end * stride);
                row(first + at * stride, low, high, self.factor(axis, at));
            }
        }
    }

    /// Adds the slopes of `values` along an axis to `out`.
    pub fn add(&self, axis: usize, values: &[f64], out: &mut [f64]) {
        let stride = self.stride(axis);
        self.rows(axis, |base, low, high, factor| {
            let (low, high) = (&values[low..low + stride], &values[high..high + stride]);
            let sums = out[base..base + stride].iter_mut();
            sums.zip(high.iter().zip(low)).for_each(|(sum, (high, low))| *sum += factor * (high - low));
        });
    }

    /// Adds the transpose of [`Slopes::add`] to `out`: each slope's value goes back to the values that make it.
    pub fn add_transposed(&self, axis: usize, slopes: &[f64], out: &mut [f64]) {
        let stride = self.stride(axis);
        self.rows(axis, |base, low, high, factor| {
            let slopes = &slopes[base..base + stride];
            out[high..high + stride].iter_mut().zip(slopes).for_each(|(sum, slope)| *sum += factor * slope);
            out[low..low + stride].iter_mut().zip(slopes).for_each(|(sum, slope)| *sum -= factor * slope);
        });
    }

    /// Divergence of a field of three components.
    pub fn divergence(&self, components: &[Vec<f64>; 3], out: &mut [f64]) {
        out.fill(0.0);
        components.iter().enumerate().for_each(|(axis, values)| self.add(axis, values, out));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Slopes {
        Slopes { shape: [5, 3, 4], spacing: [0.5, 1.0, 2.0] }
    }

    fn places() -> impl Iterator<Item = [f64; 3]> {
        (0..60).map(|i| [0.5 * (i % 5) as f64, (i / 5 % 3) as f64, 2.0 * (i / 15) as f64])
    }

    #[test]
    fn slopes_of_a_plane_are_its_own_up_to_the_ends() {
        let values: Vec<f64> = places().map(|[x, y, z]| 3.0 * x - 2.0 * y + 0.25 * z).collect();
        for (axis, wanted) in [3.0, -2.0, 0.25].into_iter().enumerate() {
            let mut slopes = vec![0.0; 60];
            grid().add(axis, &values, &mut slopes);
            assert!(slopes.iter().all(|slope| (slope - wanted).abs() < 1e-12), "{axis}: {slopes:?}");
        }
    }

    /// <slopes of a, b> = <a, transposed slopes of b>.
    #[test]
    fn the_transpose_is_one() {
        let a: Vec<f64> = (0..60).map(|i| f64::from(i * i % 17)).collect();
        let b: Vec<f64> = (0..60).map(|i| f64::from(i * 7 % 23) - 9.0).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for axis in 0..3 {
            let [mut slopes, mut back] = [vec![0.0; 60], vec![0.0; 60]];
            grid().add(axis, &a, &mut slopes);
            grid().add_transposed(axis, &b, &mut back);
            assert!((dot(&slopes, &b) - dot(&a, &back)).abs() < 1e-9, "{axis}");
        }
    }
}
