//! The depths that a camera resolves, from its lengths alone.

use super::model::{Camera, Telecentric};

/// Depth of a voxel over its width that suits the resolution: the paper's camera has light of one lenslet's width 56
/// pixels from focus, and its voxels are 10 pixels deep and 1 wide.
const PIXELS_FOR_ONE_LENSLET: f64 = 56.0;
const DEEP_VOXEL: f64 = 10.0;

impl Camera {
    /// Depth Z, mm, at which the light of a point on the axis is `width_mm` wide on the array, towards the camera; with
    /// a negative width the depth away from it. Paraxial in a medium. Infinite if no depth is so wide.
    pub fn depth_of_width_mm(&self, width_mm: f64) -> f64 {
        // From the spread by an exit pupil to that of the thin lens, the inverse of the equation in [`crate::optics`].
        let spread = width_mm / self.aperture_mm();
        if let Some(Telecentric { index }) = self.main_lens.telecentric {
            return spread * self.stop_distance_mm() * index / self.main_lens.magnification.powi(2);
        }
        let ratio = self.image_distance_mm() / self.stop_distance_mm();
        let away = ratio - (ratio * self.pupil_ratio() - 1.0) * spread;
        if away <= 0.0 {
            return f64::INFINITY.copysign(width_mm);
        }
        let beta = self.main_lens.magnification + spread / away;
        let index = self.medium.as_ref().map_or(1.0, |medium| medium.index);
        if beta <= 0.0 {
            return f64::NEG_INFINITY;
        }
        index * (self.object_distance_mm() - self.image_distance_mm() / beta)
    }

    /// Depths away from and towards the camera at which the light of a point is `count` pitches wide on the array, mm.
    pub fn depths_of_lenslets_mm(&self, count: f64) -> [f64; 2] {
        [-count, count].map(|count| self.depth_of_width_mm(count * self.microlenses.pitch_mm))
    }

    /// The depths, mm, between which the light that one pixel receives is narrower than a lenslet. Beyond them, what a
    /// camera resolves across and along the axis grows coarser with the distance from focus.
    pub fn useful_depth_mm(&self) -> [f64; 2] {
        self.depths_of_lenslets_mm(self.stop_image_px())
    }

    /// The step in depth, mm, by which the outermost sub-images of a point at depth Z move apart by one pixel.
    pub fn depth_resolution_mm(&self, z_mm: f64) -> f64 {
        let image_px = self.stop_image_px();
        if self.main_lens.telecentric.is_some() {
            return z_mm.abs() / image_px;
        }
        let index = self.medium.as_ref().map_or(1.0, |medium| medium.index);
        let beta = self.image_distance_mm() / (self.object_distance_mm() - z_mm / index);
        let alpha = (beta - self.main_lens.magnification).abs();
        alpha * self.image_distance_mm() * index / (image_px * beta * beta)
    }

    /// Pixels per voxel along x, y and z that suit the camera's resolution, for voxels of one pixel in width. Voxels of
    /// `n` pixels in width are `n` times as deep.
    pub fn suggested_pixels_per_voxel(&self) -> [f64; 3] {
        let [away, towards] = self.depths_of_lenslets_mm(1.0);
        let pixels = 0.5 * (towards - away) / self.pixel_in_focus_mm();
        let deep = (DEEP_VOXEL * pixels / PIXELS_FOR_ONE_LENSLET).round();
        [1.0, 1.0, if deep.is_finite() { deep.max(1.0) } else { DEEP_VOXEL }]
    }
}

#[cfg(test)]
mod tests {
    use crate::camera::tests::seed;
    use crate::camera::{Aperture, Camera, Layout, Medium};
    use crate::optics::Optics;
    use glam::DVec2;

    fn camera() -> Camera {
        let mut camera = seed(60, Aperture::Circle, Layout::Square, 0.0);
        camera.main_lens.magnification = 0.9;
        camera
    }

    #[test]
    fn light_is_as_wide_as_asked_at_its_depth() {
        let mut camera = camera();
        for index in [1.0, 1.333] {
            if index > 1.0 {
                camera.medium = Some(Medium { index, window_z_mm: 30.0, window_thickness_mm: 0.0, window_index: 1.0 });
            }
            let (optics, [away, towards]) = (Optics::new(&camera), camera.depths_of_lenslets_mm(7.0));
            assert!(away < 0.0 && towards > 0.0);
            // Near the axis, where the aberration of the medium vanishes.
            let near = 1e-3 * optics.half_aperture_mm;
            for z in [away, towards] {
                let hit = |u: f64| optics.array_from_object(DVec2::ZERO, z, DVec2::new(u, 0.0)).x;
                let wide = (hit(near) - hit(-near)).abs() * 1e3;
                assert!((wide / (7.0 * 0.077) - 1.0).abs() < 1e-5, "{index} {z}: {wide}");
            }
        }
        assert_eq!(camera.depth_of_width_mm(-1e3), f64::NEG_INFINITY);
    }

    #[test]
    fn outermost_sub_images_move_apart_by_a_pixel() {
        let camera = camera();
        let optics = Optics::new(&camera);
        for z in [-4.0, 2.0] {
            // The lenslet that the rim of the stop lights, and where it shows a point a little deeper.
            let place = |z: f64, centre: f64| {
                let aperture = centre / optics.alpha(z);
                optics.sensor_through(DVec2::new(centre, 0.0), DVec2::new(centre, 0.0), DVec2::new(aperture, 0.0)).x
            };
            let centre = optics.alpha(z) * optics.half_aperture_mm;
            let step = 1e-4;
            let apart_px = 2.0 * (place(z + step, centre) - place(z, centre)).abs() / optics.pixel_pitch_mm;
            let by_rays = step / apart_px;
            let resolution = camera.depth_resolution_mm(z);
            assert!((resolution / by_rays - 1.0).abs() < 1e-3, "{z}: {resolution} {by_rays}");
        }
    }

    #[test]
    fn the_seed_camera_by_hand() {
        // One lenslet at 0.308 mm = 56 px from focus; the beam of a pixel, 100 / 14 mm of the stop, at 14 times that.
        let seed = seed(60, Aperture::Circle, Layout::Square, 0.0);
        let [away, towards] = seed.useful_depth_mm();
        assert!((away + 4.36).abs() < 0.01 && (towards - 4.27).abs() < 0.01, "{away} {towards}");
        assert_eq!(seed.suggested_pixels_per_voxel(), [1.0, 1.0, 10.0]);
    }
}
