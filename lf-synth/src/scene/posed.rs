//! A scene before a camera that has a pose: volume, particles and truth stay in the common frame, and the camera sees
//! them from where it stands.

use super::keys::Scene;
use crate::particles::Particle;
use glam::DVec3;
use lf_core::{Camera, camera::Pose};
use std::borrow::Cow;

/// Particles in the camera's own frame.
pub fn seen<'a>(particles: &'a [Particle], camera: &Camera) -> Cow<'a, [Particle]> {
    let Some(pose) = &camera.pose else { return Cow::Borrowed(particles) };
    let there = |particle: &Particle| {
        let place_mm = DVec3::from(pose.to_camera(particle.place_mm.to_array()));
        Particle { place_mm, ..*particle }
    };
    Cow::Owned(particles.iter().map(there).collect())
}

impl Scene {
    /// Bounds of the volume in the camera's own frame, mm.
    pub fn seen_bounds_mm(&self, camera: &Camera) -> [[f64; 2]; 3] {
        let bounds = self.volume.bounds_mm();
        let Some(pose) = &camera.pose else { return bounds };
        let corner = |n: usize| pose.to_camera(std::array::from_fn(|axis| bounds[axis][n >> axis & 1]));
        std::array::from_fn(|axis| {
            let along = (0..8).map(|n| corner(n)[axis]);
            [along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max)]
        })
    }

    /// Seed of rays and noise: cameras that see the same particles have noise of their own.
    pub fn seed_of(&self, camera: &Camera) -> u64 {
        let mix = |seed: u64, value: &f64| (seed ^ value.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
        let numbers = |pose: &Pose| {
            let all = pose.rotation.as_flattened().iter().chain(&pose.translation_mm);
            all.fold(1, mix)
        };
        self.seed ^ camera.pose.as_ref().map_or(0, numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::ready;
    use lf_core::scene::CameraSource;

    #[test]
    fn a_camera_at_90_degrees_sees_depth_across() {
        let mut value = ready::scene("core").unwrap();
        let camera_of = |value: &serde_json::Value| {
            let scene: Scene = serde_json::from_value(value.clone()).unwrap();
            let CameraSource::Camera(camera) = &scene.camera else { panic!() };
            let camera = Camera::from_json(&camera.to_string()).unwrap();
            (scene, camera)
        };
        let (scene, camera) = camera_of(&value);
        assert_eq!((scene.seen_bounds_mm(&camera), scene.seed_of(&camera)), (scene.volume.bounds_mm(), 1));
        let pose = "camera.pose={\"rotation\": [[0,0,-1],[0,1,0],[1,0,0]], \"translation_mm\": [0,0,0.5]}";
        ready::set(&mut value, pose).unwrap();
        let (scene, camera) = camera_of(&value);
        let wanted = [[-5.0, 5.0], [-0.77, 0.77], [-0.27, 1.27]];
        for (found, wanted) in scene.seen_bounds_mm(&camera).as_flattened().iter().zip(wanted.as_flattened()) {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
        assert_ne!(scene.seed_of(&camera), 1);
        let particle = Particle { id: 3, place_mm: DVec3::new(0.2, 0.3, 1.5), intensity: 1.0, size: 1.0 };
        assert!(seen(&[particle], &camera)[0].place_mm.distance(DVec3::new(-1.5, 0.3, 0.7)) < 1e-12);
    }
}
