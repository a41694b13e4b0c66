//! From the strengths of voxels or blobs to intensities.

use lf_core::Grid;
use rayon::prelude::*;

/// A blob ends this many standard deviations from its centre. The light left out, 3e-3, is given to the rest.
const REACH_SIGMA: f64 = 3.0;

/// The brightest of the voxels within `core_vox`, `[from, to)` along x and y; 0 if there is none.
fn brightest<'a>(grid: &Grid, voxels: impl Iterator<Item = (&'a u64, &'a f32)>, core_vox: [[usize; 2]; 2]) -> f32 {
    let [[x0, x1], [y0, y1]] = core_vox;
    let in_core = |[x, y, _]: [usize; 3]| (x0..x1).contains(&x) && (y0..y1).contains(&y);
    voxels.filter(|(index, _)| in_core(grid.voxel(**index))).fold(0f32, |peak, (_, value)| peak.max(*value))
}

/// The voxels above `least_share` of the brightest within `core_vox`, unchanged.
pub(crate) fn lit(
    grid: &Grid,
    indices: &[u64],
    strengths: &[f32],
    least_share: f32,
    core_vox: [[usize; 2]; 2],
) -> (Vec<u64>, Vec<f32>) {
    let least = least_share * brightest(grid, indices.iter().zip(strengths), core_vox);
    indices.iter().zip(strengths).filter(|(_, s)| **s > least).map(|(index, s)| (*index, *s)).unzip()
}

/// Samples of a Gaussian of `sigma_vox` voxels, from its centre's left to its right; they sum to 1.
fn bell(sigma_vox: f64) -> Vec<f32> {
    let reach = (REACH_SIGMA * sigma_vox).ceil() as i64;
    let bell: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma_vox).powi(2)).exp()).collect();
    let sum: f64 = bell.iter().sum();
    bell.iter().map(|b| (b / sum) as f32).collect()
}

/// The places of `0..size` that a bell about `place` reaches, each with its share.
#[inline]
fn reached(bell: &[f32], place: usize, size: usize) -> impl Iterator<Item = (usize, f32)> {
    let reach = bell.len() / 2;
    let first = place.saturating_sub(reach);
    let shares = &bell[first + reach - place..];
    (first..size).zip(shares.iter().copied())
}

/// Strengths convolved with a Gaussian of `sigma_vox` voxels along x, y and z; its samples sum to 1. Gives the voxels
/// above `least_share` of the brightest within `core_vox`: rising, and the same for any number of threads.
pub(crate) fn spread(
    grid: &Grid,
    indices: &[u64],
    strengths: &[f32],
    sigma_vox: [f64; 3],
    least_share: f32,
    core_vox: [[usize; 2]; 2],
) -> (Vec<u64>, Vec<f32>) {
    let (indices, strengths) = lit(grid, indices, strengths, 1e-2 * least_share, core_vox);
    let [nx, ny, nz] = grid.shape;
    let [across, down, deep] = sigma_vox.map(bell);
    let slice = nx as u64 * ny as u64;
    let starts: Vec<usize> = (0..=nz as u64).map(|z| indices.partition_point(|index| *index < z * slice)).collect();

    // Add up the blobs that reach slice z.
    let blurred = |z: usize, plane: &mut Vec<f32>, touched: &mut Vec<u32>| -> Vec<(u64, f32)> {
        plane.resize(slice as usize, 0.0);
        for (source, depth) in reached(&deep, z, nz) {
            for n in starts[source]..starts[source + 1] {
                let [x, y, _] = grid.voxel(indices[n]);
                let strength = strengths[n] * depth;
                for (row, share) in reached(&down, y, ny) {
                    let in_row = strength * share;
                    for (column, share) in reached(&across, x, nx) {
                        let place = row * nx + column;
                        if plane[place] == 0.0 {
                            touched.push(place as u32);
                        }
                        plane[place] += in_row * share;
                    }
                }
            }
        }
        touched.sort_unstable();
        touched.dedup();
        let base = z as u64 * slice;
        let found = touched.iter().map(|place| (base + u64::from(*place), plane[*place as usize])).collect();
        for place in touched.drain(..) {
            plane[place as usize] = 0.0;
        }
        found
    };
    let slices: Vec<Vec<(u64, f32)>> = (0..nz)
        .into_par_iter()
        .map_init(|| (Vec::new(), Vec::new()), |(plane, touched), z| blurred(z, plane, touched))
        .collect();
    let peak = brightest(grid, slices.iter().flatten().map(|(index, value)| (index, value)), core_vox);
    slices.into_iter().flatten().filter(|(_, value)| *value > least_share * peak).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One blob of strength 8 and sigma 1. By hand its centre is 8 / (sum of exp(-i^2/2), |i| <= 3)^3.
    #[test]
    fn one_blob_by_hand() {
        let grid = Grid { shape: [9, 9, 9], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let (indices, values) = spread(&grid, &[grid.index([4, 4, 4])], &[8.0], [1.0; 3], 0.0, [[0, 9], [0, 9]]);
        let side = 1.0 + 2.0 * ((-0.5f64).exp() + (-2.0f64).exp() + (-4.5f64).exp());
        let centre = indices.iter().position(|index| *index == grid.index([4, 4, 4])).unwrap();
        assert!((f64::from(values[centre]) - 8.0 / side.powi(3)).abs() < 1e-5);
        assert_eq!(indices.len(), 343);
        assert!((values.iter().sum::<f32>() - 8.0).abs() < 1e-4);
        assert!(indices.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn blobs_at_the_edge_are_cut_and_neighbours_add() {
        let grid = Grid { shape: [3, 3, 3], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let (indices, values) = spread(&grid, &[0, 1], &[1.0, 1.0], [0.5; 3], 0.0, [[0, 3], [0, 3]]);
        assert!(indices.len() <= 27 && values.iter().all(|v| *v > 0.0));
        assert_eq!(values[0], values[1]);
    }
}
