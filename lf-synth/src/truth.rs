//! The exact volumes and displacements of a scene.

use crate::particles::Particle;
use lf_core::particles::{BATCH, REACH_SIGMA, draw};
use lf_core::{Field, Grid, History, VectorGrid, field::MEASURED, flow::Velocity};

/// Renders particles as Gaussians of `sigma_vox` voxels, see [`draw`]. Returns rising indices and intensities.
pub fn volume(grid: &Grid, particles: &[Particle], sigma_vox: f64) -> (Vec<u64>, Vec<f32>) {
    draw(grid, [sigma_vox; 3], particles.len(), |n| (particles[n].place_mm.into(), particles[n].intensity))
}

/// Largest number of bytes that [`volume`] takes for this number of particles: the lit voxels, the particles of each
/// slice, and a batch of slices.
pub fn bytes(grid: &Grid, particles: f64, sigma_vox: f64) -> f64 {
    let side = 2.0 * REACH_SIGMA * sigma_vox + 1.0;
    let lit = |axis: usize| side.min(grid.shape[axis] as f64);
    let lights = particles * lit(0) * lit(1) * lit(2);
    let voxels = grid.shape.iter().map(|n| *n as f64).product::<f64>();
    // Particles overlap at random.
    let lit_voxels = -voxels * (-lights / voxels).exp_m1();
    let slices = grid.shape[2] as f64;
    let listed = size_of::<(usize, usize, f64)>() as f64 * particles * lit(2) + size_of::<&[u8]>() as f64 * slices;
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
