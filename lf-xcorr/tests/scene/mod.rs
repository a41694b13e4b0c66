//! Clouds of Gaussian particles on a grid, before and after a displacement.
#![allow(dead_code)]

use lf_core::Grid;
use lf_xcorr::Sparse;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A sparse volume that owns its voxels.
pub struct Volume {
    pub grid: Grid,
    pub indices: Vec<u64>,
    pub intensity: Vec<f32>,
}

impl Volume {
    pub fn sparse(&self) -> Sparse<'_> {
        Sparse { grid: &self.grid, indices: &self.indices, intensity: &self.intensity }
    }

    pub fn from_dense(grid: &Grid, dense: &[f32]) -> Self {
        let indices: Vec<u64> = (0..dense.len()).filter(|&i| dense[i] > 0.0).map(|i| i as u64).collect();
        let intensity = indices.iter().map(|&i| dense[i as usize]).collect();
        Self { grid: grid.clone(), indices, intensity }
    }
}

pub fn grid(shape: [usize; 3]) -> Grid {
    Grid { shape, spacing_mm: [1.0; 3], origin_mm: [0.0; 3] }
}

/// Two volumes of `density` particles per voxel of standard deviation `sigma_vox`, displaced by minus and plus half of
/// `shift_vox` at their places. Particles also fill a margin, so that light enters and leaves through every side.
pub fn pair(
    grid: &Grid,
    density: f64,
    sigma_vox: [f64; 3],
    seed: u64,
    shift_vox: impl Fn([f64; 3]) -> [f64; 3],
) -> [Volume; 2] {
    worn_pair(grid, density, sigma_vox, seed, Wear::default(), shift_vox)
}

/// Changes of particles by recording and reconstruction.
#[derive(Clone, Copy, Default)]
pub struct Wear {
    /// Standard deviation of a particle's place in a frame, voxels.
    pub jitter_vox: [f64; 3],
    /// Share of the particles that are seen in one frame only.
    pub lost: f64,
    /// A particle's intensity in a frame is up to this share below 1.
    pub flicker: f64,
}

/// A worn [`pair`].
pub fn worn_pair(
    grid: &Grid,
    density: f64,
    sigma_vox: [f64; 3],
    seed: u64,
    wear: Wear,
    shift_vox: impl Fn([f64; 3]) -> [f64; 3],
) -> [Volume; 2] {
    let margin = sigma_vox.map(|sigma| 4.0 * sigma + 8.0);
    let extent: [f64; 3] = std::array::from_fn(|a| grid.shape[a] as f64 + 2.0 * margin[a]);
    let count = (density * extent.iter().product::<f64>()).round() as usize;
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    // Places have their own random numbers, so that wear changes no place.
    let mut worn = Pcg64Mcg::seed_from_u64(seed ^ 0x9e3779b97f4a7c15);
    let normal = move |worn: &mut Pcg64Mcg| -> f64 { (0..12).map(|_| worn.random::<f64>()).sum::<f64>() - 6.0 };
    let mut dense = [0, 1].map(|_| vec![0f32; grid.len() as usize]);
    for _ in 0..count {
        let place: [f64; 3] = std::array::from_fn(|a| random.random::<f64>() * extent[a] - margin[a] - 0.5);
        let shift = shift_vox(place);
        let missing = if worn.random::<f64>() < wear.lost { worn.random_range(0..2) } else { 2 };
        for (frame, volume) in dense.iter_mut().enumerate() {
            let jitter: [f64; 3] = std::array::from_fn(|a| wear.jitter_vox[a] * normal(&mut worn));
            let peak = 1.0 - wear.flicker * worn.random::<f64>();
            if frame != missing {
                let centre = std::array::from_fn(|a| place[a] + (frame as f64 - 0.5) * shift[a] + jitter[a]);
                splat(volume, grid, centre, sigma_vox, peak);
            }
        }
    }
    dense.map(|volume| Volume::from_dense(grid, &volume))
}

/// Adds a Gaussian particle, out to four standard deviations.
pub fn splat(dense: &mut [f32], grid: &Grid, centre_vox: [f64; 3], sigma_vox: [f64; 3], peak: f64) {
    let range = |a: usize| {
        let low = (centre_vox[a] - 4.0 * sigma_vox[a]).ceil().max(0.0) as usize;
        low..((centre_vox[a] + 4.0 * sigma_vox[a]).floor() + 1.0).clamp(0.0, grid.shape[a] as f64) as usize
    };
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let q: f64 = (0..3).map(|a| (([x, y, z][a] as f64 - centre_vox[a]) / sigma_vox[a]).powi(2)).sum();
                dense[grid.index([x, y, z]) as usize] += (peak * (-0.5 * q).exp()) as f32;
            }
        }
    }
}
