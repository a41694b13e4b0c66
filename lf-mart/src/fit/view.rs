//! A further camera that sees the same particles.

use super::noise::Noise;
use super::spot::Spot;
use lf_core::camera::Pose;
use lf_core::particle_image::ParticleModel;

/// A camera beside the first one.
#[derive(Debug, Clone)]
pub(super) struct View {
    pub(super) model: ParticleModel,
    /// From the frame of the first camera to its own.
    pub(super) pose: Pose,
    /// Its light of a particle over that of the first camera.
    pub(super) light: f64,
    pub(super) noise: Noise,
    /// A pixel at its focal plane, mm.
    pub(super) pixel_mm: f64,
}

impl View {
    /// A particle in this camera's frame, with the light that it sends there.
    pub(super) fn seen(&self, spot: &Spot) -> Spot {
        Spot { place_mm: self.pose.to_camera(spot.place_mm), light: self.light * spot.light }
    }

    /// Derivatives by the place in the first camera's frame, from those by the place in this one's: the chain rule.
    #[inline(always)]
    pub(super) fn turned(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = &self.pose.rotation;
        [a[0] * x + b[0] * y + c[0] * z, a[1] * x + b[1] * y + c[1] * z, a[2] * x + b[2] * y + c[2] * z]
    }

    /// How far a small step in the first camera's frame, mm, moves a ray on this camera's array, px at most.
    pub(super) fn moved_px(&self, step_mm: [f64; 3]) -> f64 {
        let [x, y, z] = self.along(step_mm);
        (x / self.pixel_mm).abs().max((y / self.pixel_mm).abs()).max(self.model.spread_px(z))
    }

    /// How far apart two places are sideways for this camera, pixels at its focal plane.
    pub(super) fn aside_px(&self, between_mm: [f64; 3]) -> f64 {
        let [x, y, _] = self.along(between_mm);
        x.abs().max(y.abs()) / self.pixel_mm
    }

    /// A step of the first camera's frame in this one's.
    fn along(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        self.pose.rotation.map(|[a, b, c]| a * x + b * y + c * z)
    }
}
