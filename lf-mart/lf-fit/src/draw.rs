//! Particles drawn into a volume.

use crate::particle::Particle;
use lf_core::Grid;
use rayon::prelude::*;

/// A Gaussian ends after this many standard deviations; the light left out is 2e-4.
const REACH_SIGMA: f64 = 4.0;

/// Draws particles as Gaussians of `sigma_vox` voxels, sampled at the voxels' centres. Each sums to its particle's
/// light unless the grid's edge cuts it. Gives rising indices and intensities.
pub fn draw(grid: &Grid, particles: &[Particle], sigma_vox: [f64; 3]) -> (Vec<u64>, Vec<f32>) {
    let shares = |axis: usize, particle: &Particle| {
        let place = grid.place_vox(axis, particle.place_mm[axis]);
        let reach = REACH_SIGMA * sigma_vox[axis];
        let (first, last) = ((place - reach).ceil() as i64, (place + reach).floor() as i64);
        let bell = |i: i64| (-0.5 * ((i as f64 - place) / sigma_vox[axis]).powi(2)).exp();
        let sum: f64 = (first..=last).map(bell).sum();
        let within = first.max(0)..=last.min(grid.shape[axis] as i64 - 1);
        (*within.start() as usize, within.map(|i| bell(i) / sum).collect::<Vec<f64>>())
    };
    // Parts of particles by slice: a huge grid costs no more than its particles.
    let mut parts: Vec<(usize, usize, f64)> = Vec::new();
    for (n, particle) in particles.iter().enumerate() {
        let (first, shares) = shares(2, particle);
        parts.extend(shares.iter().enumerate().map(|(z, share)| (first + z, n, particle.light * share)));
    }
    parts.sort_by_key(|(z, n, _)| (*z, *n));
    let slices: Vec<&[(usize, usize, f64)]> = parts.chunk_by(|a, b| a.0 == b.0).collect();
    let lit = slices.par_iter().map(|members| {
        let mut voxels: Vec<(u64, f32)> = Vec::new();
        for &(z, n, light) in *members {
            let ((left, across), (top, down)) = (shares(0, &particles[n]), shares(1, &particles[n]));
            for (y, wy) in down.iter().enumerate() {
                let voxel = |(x, wx): (usize, &f64)| (grid.index([left + x, top + y, z]), (light * wx * wy) as f32);
                voxels.extend(across.iter().enumerate().map(voxel));
            }
        }
        voxels.sort_by_key(|(index, _)| *index);
        let sum = |run: &[(u64, f32)]| (run[0].0, run.iter().map(|(_, value)| value).sum::<f32>());
        voxels.chunk_by(|a, b| a.0 == b.0).map(sum).unzip()
    });
    let (indices, intensity): (Vec<Vec<u64>>, Vec<Vec<f32>>) = lit.unzip();
    (indices.concat(), intensity.concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// More slices than memory holds.
    #[test]
    fn a_huge_grid_is_drawn() {
        let grid = Grid { shape: [4, 4, 1 << 40], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let particles = [3e11, 5.0].map(|z| Particle { place_mm: [1.0, 2.0, z], light: 2.0 });
        let (indices, intensity) = draw(&grid, &particles, [0.3; 3]);
        assert!(indices.windows(2).all(|pair| pair[0] < pair[1]));
        assert!((intensity.iter().sum::<f32>() - 4.0).abs() < 1e-5);
    }

    #[test]
    fn a_particle_keeps_its_light_and_place() {
        let grid = Grid { shape: [20, 20, 20], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0; 3] };
        let place_mm = [1.03, 0.88, 9.7];
        let (indices, intensity) = draw(&grid, &[Particle { place_mm, light: 50.0 }], [0.75; 3]);
        assert!(indices.windows(2).all(|pair| pair[0] < pair[1]));
        let sum: f64 = intensity.iter().map(|value| f64::from(*value)).sum();
        assert!((sum - 50.0).abs() < 1e-4);
        for axis in 0..3 {
            let moment =
                |(index, value): (&u64, &f32)| grid.centre_mm(axis, grid.voxel(*index)[axis]) * f64::from(*value);
            let mean = indices.iter().zip(&intensity).map(moment).sum::<f64>() / sum;
            assert!((mean - place_mm[axis]).abs() < 2e-3 * grid.spacing_mm[axis], "{mean}");
        }
    }
}
