//! The exact volumes and displacements of a scene.

use crate::particles::Particle;
use lf_core::{Field, Grid, History, VectorGrid, field::MEASURED, flow::Velocity};
use rayon::prelude::*;

/// Reach of a particle along each axis, in standard deviations. The light left out is 2e-4.
const REACH_SIGMA: f64 = 4.0;

/// Renders particles as Gaussians of `sigma_vox` voxels, sampled at voxel centres. Each sums to its particle's
/// intensity. Returns rising indices and intensities. Each voxel adds up the particles in their order.
pub fn volume(grid: &Grid, particles: &[Particle], sigma_vox: f64) -> (Vec<u64>, Vec<f32>) {
    let reach = REACH_SIGMA * sigma_vox;
    let most_across = (2.0 * reach + 1.0).powi(2) as usize;
    // First voxel along an axis, and the shares of the particle's light in it and the next ones.
    let shares_along = |axis: usize, particle: &Particle| {
        let place = grid.place_vox(axis, particle.place_mm[axis]);
        let (first, last) = ((place - reach).ceil() as i64, (place + reach).floor() as i64);
        let bell = |i: i64| (-0.5 * ((i as f64 - place) / sigma_vox).powi(2)).exp();
        let sum: f64 = (first..=last).map(bell).sum();
        let within = first.max(0)..=last.min(grid.shape[axis] as i64 - 1);
        (*within.start() as usize, within.map(|i| bell(i) / sum).collect::<Vec<f64>>())
    };
    let mut slices: Vec<Vec<(usize, f64)>> = vec![Vec::new(); grid.shape[2]];
    for (n, particle) in particles.iter().enumerate() {
        let (first, shares) = shares_along(2, particle);
        for (z, share) in shares.iter().enumerate() {
            slices[first + z].push((n, particle.intensity * share));
        }
    }
    let lit = |(z, members): (usize, &Vec<(usize, f64)>)| {
        let mut voxels: Vec<(u64, f32)> = Vec::with_capacity(members.len() * most_across);
        for &(n, light) in members {
            let ((left, across), (top, down)) = (shares_along(0, &particles[n]), shares_along(1, &particles[n]));
            for (y, wy) in down.iter().enumerate() {
                for (x, wx) in across.iter().enumerate() {
                    voxels.push((grid.index([left + x, top + y, z]), (light * wx * wy) as f32));
                }
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
    for (n, batch) in slices.chunks(BATCH).enumerate() {
        let numbered = batch.par_iter().enumerate().map(|(z, members)| (n * BATCH + z, members));
        let voxels: Vec<Vec<(u64, f32)>> = numbered.map(lit).collect();
        indices.extend(voxels.iter().flatten().map(|(index, _)| index));
        intensity.extend(voxels.iter().flatten().map(|(_, value)| value));
    }
    (indices, intensity)
}

/// Slices that are made at a time.
const BATCH: usize = 16;

/// Peak bytes of [`volume`] for a number of particles: the lit voxels, the particles of each slice, and a batch of
/// slices.
pub fn bytes(grid: &Grid, particles: f64, sigma_vox: f64) -> f64 {
    let side = 2.0 * REACH_SIGMA * sigma_vox + 1.0;
    let lit = |axis: usize| side.min(grid.shape[axis] as f64);
    let lights = particles * lit(0) * lit(1) * lit(2);
    let voxels = grid.shape.iter().map(|n| *n as f64).product::<f64>();
    // Particles overlap at random.
    let lit_voxels = -voxels * (-lights / voxels).exp_m1();
    let slices = grid.shape[2] as f64;
    let listed = size_of::<(usize, f64)>() as f64 * particles * lit(2) + 24.0 * slices;
    let batch = (BATCH as f64 / slices).min(1.0);
    let at_once = (rayon::current_num_threads().min(BATCH) as f64 / slices).min(1.0);
    // A sort that keeps the order takes half as much again.
    12.0 * lit_voxels + 1.5 * listed + 16.0 * (batch * lit_voxels + 1.5 * at_once * lights)
}

/// The displacement during `interval` on a lattice of `shape` places whose outermost lie on the bounds; see
/// [`Velocity::displacement_mm`].
pub fn displacement(
    flow: &Velocity,
    interval: f64,
    bounds_mm: [[f64; 2]; 3],
    shape: [usize; 3],
    voxel_mm: [f64; 3],
    history: History,
) -> Field {
    let spacing_mm: [f64; 3] = std::array::from_fn(|a| (bounds_mm[a][1] - bounds_mm[a][0]) / (shape[a] - 1) as f64);
    let origin_mm = bounds_mm.map(|[low, _]| low);
    let layout =
        VectorGrid { shape, spacing_mm, origin_mm, voxel_mm, window: [0; 3], overlap: 0.0, dt_s: None, history };
    let mut field = Field::empty(layout);
    let places: Vec<[f64; 3]> = (0..field.len()).map(|n| field.place_mm(n)).collect();
    for (n, vector) in flow.displacements_mm(&places, interval).into_iter().enumerate() {
        [field.u[n], field.v[n], field.w[n]] = vector.map(|mm| mm as f32);
    }
    field.peak.fill(1.0);
    field.flag.fill(MEASURED);
    field
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_particle_keeps_its_intensity_and_place() {
        let grid = Grid { shape: [20, 20, 20], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0; 3] };
        let place_mm = DVec3::new(1.03, 0.88, 9.7);
        let particles = [Particle { id: 0, place_mm, intensity: 50.0, size: 1.0 }];
        let (indices, intensity) = volume(&grid, &particles, 0.75);
        assert!(indices.windows(2).all(|pair| pair[0] < pair[1]));
        let sum: f64 = intensity.iter().map(|v| f64::from(*v)).sum();
        assert!((sum - 50.0).abs() < 1e-4);
        for axis in 0..3 {
            let mean = indices
                .iter()
                .zip(&intensity)
                .map(|(i, v)| grid.centre_mm(axis, grid.voxel(*i)[axis]) * f64::from(*v))
                .sum::<f64>()
                / sum;
            assert!((mean - place_mm[axis]).abs() < 2e-3 * grid.spacing_mm[axis], "{mean}");
        }
    }

    #[test]
    fn neighbouring_particles_add_up() {
        let grid = Grid { shape: [8, 8, 8], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let particle = |id, x| Particle { id, place_mm: DVec3::new(x, 4.0, 4.0), intensity: 1.0, size: 1.0 };
        let both = volume(&grid, &[particle(0, 3.0), particle(1, 4.0)], 0.75);
        let sum: f32 = both.1.iter().sum();
        assert!((sum - 2.0).abs() < 1e-3);
        assert!(both.0.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
