//! Particles as matching and fitting see them.

use glam::{DMat3, DVec3};
use lf_core::Particle;

/// Constant: minimum standard uncertainty of a place, voxels. Exact particles would have infinite weight.
const MINIMUM_VOX: f64 = 1e-4;

/// Constant: standard uncertainty of a place without one, voxels, as centroids of reconstructed particles have it. The
/// residuals of the pairs scale the vectors' uncertainties.
const UNSTATED_VOX: f64 = 0.25;

/// A particle of a frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Point {
    pub place_mm: DVec3,
    pub covariance_mm2: DMat3,
    /// Natural logarithm of the light, and its variance; NaN without light.
    pub log_light: f64,
    pub log_variance: f64,
}

impl Point {
    /// A particle without uncertainties counts as uncertain by [`UNSTATED_VOX`] along each axis.
    pub fn new(particle: &Particle, voxel_mm: DVec3) -> Self {
        let floor = (MINIMUM_VOX * voxel_mm) * (MINIMUM_VOX * voxel_mm);
        let known = particle.uncertainty;
        let unstated = (UNSTATED_VOX * voxel_mm) * (UNSTATED_VOX * voxel_mm);
        let covariance = known.map_or(DMat3::from_diagonal(unstated), |known| known.covariance_mm2);
        let share = known.map_or(0.0, |known| known.intensity) / particle.intensity;
        Self {
            place_mm: particle.place_mm.into(),
            covariance_mm2: covariance + DMat3::from_diagonal(floor),
            log_light: if particle.intensity > 0.0 { particle.intensity.ln() } else { f64::NAN },
            log_variance: share * share,
        }
    }
}
