//! Exact rays: object point, main lens, lenslet, sensor. Knows no weights.
//!
//! **Object frame.** Origin where the optical axis meets the focal plane (conjugate to the array); X right, Y down as
//! image rows run, Z towards the camera; mm. **Sensor frame.** x along columns, y along rows, origin on the axis, mm;
//! pixel (i, j) covers `[(i - W/2) pp, (i + 1 - W/2) pp]` in x and likewise j, H in y. The lens inverts the image and
//! nothing turns it back.
//!
//! A ray leaves (X, Y, Z), passes the aperture at (U, V), meets the array at (x_m, y_m), the lenslet with centre c whose
//! cell holds that point, and the sensor at (x_s, y_s); Y, V behave as X, U:
//!
//! ```text
//! beta(Z)  = s_i / (s_o - Z)
//! alpha(Z) = 1 - s_i / f + beta(Z)
//! x_m      = -beta X + alpha U
//! x_s      = c + k (x_m - U)
//! ```
//!
//! A thin microlens with the sensor at its focal distance: what leaves one U meets one place under a lenslet, so the
//! *image* of a lenslet is centred at c (1 + k), not at c.

use crate::camera::{Aperture, Camera, Lattice};
use glam::DVec2;

/// The rays of one camera.
#[derive(Debug, Clone)]
pub struct Optics {
    image_distance_mm: f64,
    object_distance_mm: f64,
    focal_length_mm: f64,
    demagnification: f64,
    half_aperture_mm: f64,
    aperture: Aperture,
    lattice: Lattice,
    width: usize,
    height: usize,
    pixel_pitch_mm: f64,
}

impl Optics {
    /// The rays of a checked camera.
    pub fn new(camera: &Camera) -> Self {
        Self {
            image_distance_mm: camera.image_distance_mm(),
            object_distance_mm: camera.object_distance_mm(),
            focal_length_mm: camera.main_lens.focal_length_mm,
            demagnification: camera.demagnification(),
            half_aperture_mm: 0.5 * camera.aperture_mm(),
            aperture: camera.main_lens.aperture,
            lattice: camera.lattice(),
            width: camera.sensor.width,
            height: camera.sensor.height,
            pixel_pitch_mm: camera.sensor.pixel_pitch_mm,
        }
    }

    /// Local magnification beta(Z); Z must lie before the main lens, Z < s_o.
    #[inline]
    pub fn beta(&self, z_mm: f64) -> f64 {
        self.image_distance_mm / (self.object_distance_mm - z_mm)
    }

    /// Spread on the array per aperture length, alpha(Z); 0 at the focal plane.
    #[inline]
    pub fn alpha(&self, z_mm: f64) -> f64 {
        1.0 - self.image_distance_mm / self.focal_length_mm + self.beta(z_mm)
    }

    /// k = f_l / s_i.
    #[inline]
    pub fn demagnification(&self) -> f64 {
        self.demagnification
    }

    /// D / 2, mm.
    #[inline]
    pub fn half_aperture_mm(&self) -> f64 {
        self.half_aperture_mm
    }

    /// The microlens lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Whether the stop lets a ray through.
    #[inline]
    pub fn passes(&self, aperture_mm: DVec2) -> bool {
        match self.aperture {
            Aperture::Circle => aperture_mm.length_squared() <= self.half_aperture_mm * self.half_aperture_mm,
            Aperture::Square => aperture_mm.abs().max_element() <= self.half_aperture_mm,
        }
    }

    /// Where a ray meets the array, mm.
    #[inline]
    pub fn array_from_object(&self, object_mm: DVec2, z_mm: f64, aperture_mm: DVec2) -> DVec2 {
        -self.beta(z_mm) * object_mm + self.alpha(z_mm) * aperture_mm
    }

    /// Where a ray that meets the array at `array_mm` from the aperture at `aperture_mm` meets the sensor, mm.
    #[inline]
    pub fn sensor_from_array(&self, array_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        let (i, j) = self.lattice.lenslet_at(array_mm);
        self.lattice.centre_mm(i, j) + self.demagnification * (array_mm - aperture_mm)
    }

    /// Where a ray meets the sensor, mm.
    #[inline]
    pub fn sensor_from_object(&self, object_mm: DVec2, z_mm: f64, aperture_mm: DVec2) -> DVec2 {
        self.sensor_from_array(self.array_from_object(object_mm, z_mm, aperture_mm), aperture_mm)
    }

    /// A place on the sensor in pixels: 0 is the left or top edge, a pixel's centre is at a half.
    #[inline]
    pub fn place_px(&self, sensor_mm: DVec2) -> DVec2 {
        sensor_mm / self.pixel_pitch_mm + 0.5 * DVec2::new(self.width as f64, self.height as f64)
    }

    /// Column and row of the pixel under a place on the sensor; none beside the sensor.
    #[inline]
    pub fn pixel_at(&self, sensor_mm: DVec2) -> Option<(usize, usize)> {
        let place = self.place_px(sensor_mm);
        let inside = place.x >= 0.0 && place.y >= 0.0 && place.x < self.width as f64 && place.y < self.height as f64;
        inside.then_some((place.x as usize, place.y as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Layout;
    use crate::camera::tests::seed;

    fn optics(rotation_rad: f64) -> Optics {
        Optics::new(&seed(20, Aperture::Circle, Layout::Square, rotation_rad))
    }

    #[test]
    fn a_point_in_focus_stays_under_one_lenslet_and_fills_its_disc() {
        let optics = optics(0.0);
        assert!(optics.alpha(0.0).abs() < 1e-15);
        let centre = optics.lattice().centre_mm(2, -3);
        for angle in 0..12 {
            let rim = DVec2::from_angle(angle as f64) * optics.half_aperture_mm();
            let hit = optics.sensor_from_object(-centre, 0.0, rim);
            // The lens turns the disc over: U lands at c (1 + k) - k U, and k D/2 is half a pitch.
            let expected = centre * (1.0 + optics.demagnification()) - rim.normalize() * 0.0385;
            assert!(hit.distance(expected) < 1e-12);
        }
    }

    #[test]
    fn sub_images_drift_with_depth_by_the_slope_of_the_paper_drawing() {
        // By hand: m = 1, s_i = s_o = 400, Z = 4: beta = 400/396, alpha = 4/396. A point on the axis lights lenslet c
        // through U = c / alpha, which lands at c + k (c - c / alpha): k (1 - 1/alpha) = 0.00077 (1 - 99) px per px.
        let optics = optics(0.0);
        let centre = optics.lattice().centre_mm(4, 0).x;
        let aperture = DVec2::new(centre / (4.0 / 396.0), 0.0);
        let hit = optics.sensor_from_object(DVec2::ZERO, 4.0, aperture);
        assert!((hit.x - centre * (1.0 + 0.00077 * (1.0 - 99.0))).abs() < 1e-12);
    }

    #[test]
    fn pixels_are_counted_from_the_top_left_corner() {
        let optics = optics(0.0);
        assert_eq!(optics.pixel_at(DVec2::new(0.001, -0.001)), Some((140, 139)));
        assert_eq!(optics.pixel_at(DVec2::new(-0.77 + 1e-9, 0.77 - 1e-9)), Some((0, 279)));
        assert_eq!(optics.pixel_at(DVec2::new(0.7701, 0.0)), None);
    }
}
