//! Particles drawn into a volume.

use crate::Grid;
use rayon::prelude::*;

/// A Gaussian ends after this many standard deviations along each axis; the light left out is 2e-4.
pub const REACH_SIGMA: f64 = 4.0;
/// Slices that are made at a time.
pub const BATCH: usize = 16;

/// Draws particles as Gaussians of `sigma_vox` voxels, sampled at the voxels' centres. `particle` gives the place, mm,
/// and the light of each of `count` particles; its Gaussian sums to this light unless the grid's edge cuts it. Returns
/// rising indices and intensities. Each voxel adds up the particles in their order.
pub fn draw(
    grid: &Grid,
    sigma_vox: [f64; 3],
    count: usize,
    particle: impl Fn(usize) -> ([f64; 3], f64) + Sync,
) -> (Vec<u64>, Vec<f32>) {
    // First voxel along an axis, and the shares of the particle's light in it and the next ones.
    let shares_along = |axis: usize, place_mm: [f64; 3]| {
        let (place, reach) = (grid.place_vox(axis, place_mm[axis]), REACH_SIGMA * sigma_vox[axis]);
        let (first, last) = ((place - reach).ceil() as i64, (place + reach).floor() as i64);
        let bell = |i: i64| (-0.5 * ((i as f64 - place) / sigma_vox[axis]).powi(2)).exp();
        let sum: f64 = (first..=last).map(bell).sum();
        let within = first.max(0)..=last.min(grid.shape[axis] as i64 - 1);
        (*within.start() as usize, within.map(|i| bell(i) / sum).collect::<Vec<f64>>())
    };
    // List the parts of particles by slice: a huge grid costs no more than its particles.
    let mut parts: Vec<(usize, usize, f64)> = Vec::new();
    for n in 0..count {
        let (place_mm, light) = particle(n);
        let (first, shares) = shares_along(2, place_mm);
        parts.extend(shares.iter().enumerate().map(|(z, share)| (first + z, n, light * share)));
    }
    parts.sort_unstable_by_key(|(z, n, _)| (*z, *n));
    let slices: Vec<&[(usize, usize, f64)]> = parts.chunk_by(|a, b| a.0 == b.0).collect();
    // Draw each slice, and add up the particles in each voxel.
    let lit = |members: &&[(usize, usize, f64)]| {
        let mut voxels: Vec<(u64, f32)> = Vec::new();
        for &(z, n, light) in *members {
            let (place_mm, _) = particle(n);
            let ((left, across), (top, down)) = (shares_along(0, place_mm), shares_along(1, place_mm));
            for (y, wy) in down.iter().enumerate() {
                let voxel = |(x, wx): (usize, &f64)| (grid.index([left + x, top + y, z]), (light * wx * wy) as f32);
                voxels.extend(across.iter().enumerate().map(voxel));
            }
        }
        voxels.sort_by_key(|(index, _)| *index);
        voxels.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            kept.1 += if is_same { next.1 } else { 0.0 };
            is_same
        });
        voxels.shrink_to_fit();
        voxels
    };
    let (mut indices, mut intensity) = (Vec::new(), Vec::new());
    for batch in slices.chunks(BATCH) {
        let voxels: Vec<Vec<(u64, f32)>> = batch.par_iter().map(lit).collect();
        indices.extend(voxels.iter().flatten().map(|(index, _)| index));
        intensity.extend(voxels.iter().flatten().map(|(_, value)| value));
    }
    (indices, intensity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_particle_keeps_its_light_and_place() {
        let grid = Grid { shape: [20, 20, 20], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0; 3] };
        let place_mm = [1.03, 0.88, 9.7];
        let (indices, intensity) = draw(&grid, [0.75; 3], 1, |_| (place_mm, 50.0));
        assert!(indices.is_sorted_by(|a, b| a < b));
        let sum: f64 = intensity.iter().map(|value| f64::from(*value)).sum();
        assert!((sum - 50.0).abs() < 1e-5, "{sum}");
        for axis in 0..3 {
            let moment =
                |(index, value): (&u64, &f32)| grid.centre_mm(axis, grid.voxel(*index)[axis]) * f64::from(*value);
            let mean = indices.iter().zip(&intensity).map(moment).sum::<f64>() / sum;
            assert!((mean - place_mm[axis]).abs() < 2e-3 * grid.spacing_mm[axis], "{mean}");
        }
    }

    #[test]
    fn neighbours_add_up() {
        let grid = Grid { shape: [8, 8, 8], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let one = |x: f64| draw(&grid, [0.75; 3], 1, |_| ([x, 4.0, 4.0], 1.0));
        let (indices, intensity) = draw(&grid, [0.75; 3], 2, |n| ([3.0 + n as f64, 4.0, 4.0], 1.0));
        assert!(indices.is_sorted_by(|a, b| a < b));
        let at = |(indices, values): &(Vec<u64>, Vec<f32>), index: u64| {
            indices.iter().position(|known| *known == index).map_or(0.0, |n| values[n])
        };
        let apart = [one(3.0), one(4.0)];
        for (index, value) in indices.iter().zip(&intensity) {
            assert_eq!(*value, at(&apart[0], *index) + at(&apart[1], *index));
        }
    }

    /// More slices than memory holds.
    #[test]
    fn a_huge_grid_is_drawn() {
        let grid = Grid { shape: [4, 4, 1 << 40], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let (indices, intensity) = draw(&grid, [0.3; 3], 2, |n| ([1.0, 2.0, [3e11, 5.0][n]], 2.0));
        assert!(indices.is_sorted_by(|a, b| a < b));
        assert!((intensity.iter().sum::<f32>() - 4.0).abs() < 1e-5);
    }
}
