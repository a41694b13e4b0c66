//! Between lenslets and the centres of their images.
//!
//! A ray through the middle of the stop (U = 0) is not refracted at a lenslet's centre c. It meets the sensor at c (1 +
//! g / l), where l is the distance of the exit pupil (s_i in a thin lens) and g the gap along the ray: on a sensor
//! tilted by slopes t, g = (g_0 + t . c) / (1 - t . c / l). The inverse for an image at x is exact: c = x l / (l + g_0
//! + t . x); without tilt c = x / (1 + k).

use glam::DVec2;
use lf_core::{Camera, Optics};

/// Maps lenslet centres to image centres and back. The camera's own lattice plays no part.
pub(crate) struct LensletImages {
    stop_distance_mm: f64,
    pupil_ratio: f64,
    gap_mm: f64,
    slope: DVec2,
    pixel_pitch_mm: f64,
    middle_px: DVec2,
}

impl LensletImages {
    pub fn new(camera: &Camera) -> Self {
        Self {
            stop_distance_mm: camera.stop_distance_mm(),
            pupil_ratio: camera.pupil_ratio(),
            gap_mm: camera.gap_mm(),
            slope: camera.tilt.as_ref().map_or(DVec2::ZERO, |tilt| DVec2::new(tilt.x_rad.tan(), tilt.y_rad.tan())),
            pixel_pitch_mm: camera.sensor.pixel_pitch_mm,
            middle_px: 0.5 * DVec2::new(camera.sensor.width as f64, camera.sensor.height as f64),
        }
    }

    /// Lenslet centre on the array, mm, from its image centre, px from the image's left and top edge.
    pub fn lenslet_mm(&self, image_px: DVec2) -> DVec2 {
        self.lenslet_from_image((image_px - self.middle_px) * self.pixel_pitch_mm)
    }

    /// Lenslet centre from its image centre, both mm from the sensor's middle.
    pub fn lenslet_from_image(&self, image_mm: DVec2) -> DVec2 {
        let distance =
            self.stop_distance_mm + self.pupil_ratio * self.gap_mm + self.pupil_ratio * self.slope.dot(image_mm);
        image_mm * self.stop_distance_mm / distance
    }

    /// Image centre from the lenslet centre, both mm from the sensor's middle.
    pub fn image_from_lenslet(&self, lenslet_mm: DVec2) -> DVec2 {
        let distance = self.stop_distance_mm - self.pupil_ratio * self.slope.dot(lenslet_mm);
        lenslet_mm * (self.stop_distance_mm + self.pupil_ratio * self.gap_mm) / distance
    }

    /// Length on the array, mm, for one pixel between lenslet images, in the middle of the sensor.
    pub fn lenslet_mm_per_px(&self) -> f64 {
        self.pixel_pitch_mm / (1.0 + self.gap_mm / self.stop_distance_mm * self.pupil_ratio)
    }
}

/// Image centre of a lenslet at `lenslet_mm`, px from the image's left and top edge.
pub(crate) fn image_px(optics: &Optics, lenslet_mm: DVec2) -> DVec2 {
    // A ray through the lenslet's centre is not refracted there, so the lattice need not hold this lenslet.
    optics.place_px(optics.sensor_from_array(lenslet_mm, DVec2::ZERO))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::view::tests::seed;
    use lf_core::camera::{Layout, Tilt};

    #[test]
    fn rays_through_lenslet_centres_are_followed_back() {
        let mut plain = seed(40, Layout::Square);
        plain.microlenses.rotation_rad = 0.01;
        plain.microlenses.offset_mm = [0.01, 0.02];
        let mut gap = plain.clone();
        gap.microlenses.gap_mm = Some(0.33);
        let mut tilted = gap.clone();
        tilted.tilt = Some(Tilt { x_rad: 0.02, y_rad: -0.01 });
        let mut pupil = tilted.clone();
        pupil.main_lens.pupil_distance_mm = Some(610.0);
        let far = |vergence| {
            let mut camera = tilted.clone();
            camera.main_lens.pupil_vergence_per_mm = Some(vergence);
            camera
        };
        let (infinite, behind) = (far(0.0), far(-0.002));
        for camera in [plain, gap, tilted, pupil, infinite, behind] {
            let (places, optics) = (LensletImages::new(&camera), Optics::new(&camera));
            for (i, j) in [(0, 0), (19, -12), (-20, 3)] {
                let centre = camera.lattice().centre_mm(i, j);
                assert!(places.lenslet_mm(image_px(&optics, centre)).distance(centre) < 1e-12, "{i} {j}");
                let image = places.image_from_lenslet(centre);
                assert!(image.distance(optics.sensor_from_array(centre, DVec2::ZERO)) < 1e-12, "{i} {j}");
            }
            let step = places.lenslet_mm(places.middle_px + DVec2::X).x - places.lenslet_mm(places.middle_px).x;
            assert!((step / places.lenslet_mm_per_px() - 1.0).abs() < 1e-5);
        }
    }
}
