//! A preconditioner for smoothing: exact where weights depend on z alone.
//!
//! Equation: the matrix is `W + s K`, with weights W, strength s and the roughness `K = Kx + Ky + Kz`. Uncertainties of
//! a light-field camera depend on depth far more than on x and y, so W's means over planes across z replace W here.
//! The modes of Kx and Ky then separate, and each pair of modes leaves a matrix with two bands along z:
//! `w(z) + s (kx + ky) + s Kz`.

use super::bands::Bands;
use super::roughness::Roughness;
use nalgebra::{DMatrix, SymmetricEigen};

/// The modes of the roughness along an axis.
pub(super) struct Modes {
    count: usize,
    /// Mode m at place i: at `m + count * i`.
    rows: Vec<f64>,
    /// Place i of mode m: at `i + count * m`.
    columns: Vec<f64>,
    /// Roughness of each mode.
    roughness: Vec<f64>,
}

impl Modes {
    fn new(count: usize) -> Self {
        let bands = Roughness::bands(count);
        let entry = |i: usize, j: usize| bands[i.min(j)].get(i.abs_diff(j)).copied().unwrap_or(0.0);
        let found = SymmetricEigen::new(DMatrix::from_fn(count, count, entry));
        let columns = found.eigenvectors.as_slice().to_vec();
        let rows = (0..count * count).map(|n| columns[n / count + count * (n % count)]).collect();
        Self { count, rows, columns, roughness: found.eigenvalues.as_slice().to_vec() }
    }
}

/// Multiplies `from` by a square matrix along an axis whose neighbours are `stride` apart: row i of `matrix`, times the
/// values at place i, is added to all places of `to`.
fn multiply(matrix: &[f64], count: usize, stride: usize, from: &[f64], to: &mut [f64]) {
    to.fill(0.0);
    for (from, to) in from.chunks_exact(count * stride).zip(to.chunks_exact_mut(count * stride)) {
        for (row, from) in matrix.chunks_exact(count).zip(from.chunks_exact(stride)) {
            if stride == 1 {
                to.iter_mut().zip(row).for_each(|(to, entry)| *to += entry * from[0]);
                continue;
            }
            for (entry, to) in row.iter().zip(to.chunks_exact_mut(stride)) {
                to.iter_mut().zip(from).for_each(|(to, from)| *to += entry * from);
            }
        }
    }
}

/// The modes along x and y.
pub(super) struct Planes {
    shape: [usize; 3],
    x: Modes,
    y: Modes,
}

impl Planes {
    pub fn new(shape: [usize; 3]) -> Self {
        Self { shape, x: Modes::new(shape[0]), y: Modes::new(shape[1]) }
    }

    /// The bands along z, mode by mode, for these weights.
    pub fn bands(&self, weights: &[f64], strength: f64) -> Bands {
        let [nx, ny, nz] = self.shape;
        let plane = nx * ny;
        let means: Vec<f64> = weights.chunks_exact(plane).map(|all| all.iter().sum::<f64>() / plane as f64).collect();
        let along = Roughness::bands(nz);
        let entry = |first: usize, i: usize, back: usize| {
            let own = if back > 0 {
                0.0
            } else {
                means[i] + strength * (self.x.roughness[first % nx] + self.y.roughness[first / nx])
            };
            own + strength * along[i - back][back]
        };
        Bands::new(plane, nz, weights.len(), entry)
    }

    /// Solves for `right`; `work` has its size.
    pub fn solve(&self, bands: &Bands, right: &[f64], out: &mut [f64], work: &mut [f64]) {
        let Self { shape: [nx, ..], x, y } = self;
        // Go to the modes along x and y, solve along z, and go back.
        multiply(&x.rows, x.count, 1, right, work);
        multiply(&y.rows, y.count, *nx, work, out);
        bands.solve(out);
        multiply(&y.columns, y.count, *nx, out, work);
        multiply(&x.columns, x.count, 1, work, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With weights that depend on z alone, the solution is exact.
    #[test]
    fn planes_of_even_weights_are_solved_exactly() {
        let shape = [6, 5, 7];
        let wanted: Vec<f64> = (0..210).map(|i| f64::from(i * i % 31) - 15.0).collect();
        let weights: Vec<f64> = (0..210).map(|i| 1.0 + f64::from(i / 30)).collect();
        let mut right: Vec<f64> = wanted.iter().zip(&weights).map(|(value, weight)| value * weight).collect();
        Roughness::new(shape).add(4.0, &wanted, &mut right);
        let planes = Planes::new(shape);
        let [mut found, mut work] = [vec![0.0; 210], vec![0.0; 210]];
        planes.solve(&planes.bands(&weights, 4.0), &right, &mut found, &mut work);
        let worst = found.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst}");
    }
}
