//! Aberrations of the main lens: what is refused, and the shift of a ray.

use super::file::finite;
use super::model::{Aberrations, Camera};
use crate::Refusal;
use glam::DVec2;

/// The aberrations of a camera in mm, with the lengths that its rays are measured by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RayAberrations {
    spherical_mm: f64,
    secondary_spherical_mm: f64,
    coma_mm: f64,
    /// Growth of the coma for a mm of depth.
    coma_growth: f64,
    astigmatism_mm: f64,
    field_curvature_mm: f64,
    /// 1 over the half width of the stop, and 1 over half the sensor's diagonal.
    per_half: f64,
    per_corner: f64,
}

impl RayAberrations {
    pub(crate) fn new(camera: &Camera) -> Option<Self> {
        let terms = camera.aberrations?;
        let pixel_mm = camera.sensor.pixel_pitch_mm;
        Some(Self {
            spherical_mm: terms.spherical_px * pixel_mm,
            secondary_spherical_mm: terms.secondary_spherical_px * pixel_mm,
            coma_mm: terms.coma_px * pixel_mm,
            coma_growth: terms.coma_px_per_mm * pixel_mm,
            astigmatism_mm: terms.astigmatism_px * pixel_mm,
            field_curvature_mm: terms.field_curvature_px * pixel_mm,
            per_half: 2.0 / camera.aperture_mm(),
            per_corner: 2.0 / (pixel_mm * camera.diagonal_px()),
        })
    }

    /// The aberrations of a point at a depth.
    #[inline(always)]
    pub(crate) fn at(self, z_mm: f64) -> Self {
        Self { coma_mm: self.coma_mm + z_mm * self.coma_growth, ..self }
    }

    /// How far the ray through a place of the stop moves on the array, mm. The point's chief ray meets the array at
    /// `chief_mm`.
    #[inline(always)]
    pub(crate) fn shift_mm(&self, chief_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        let (u, h) = (self.per_half * aperture_mm, self.per_corner * chief_mm);
        let (r2, along) = (u.length_squared(), u.dot(h));
        u * self.by_stop_mm(r2, along, h) + h * (self.coma_mm * r2 + self.astigmatism_mm * along)
    }

    /// The part of the shift that is along the place in the stop, over that place, for its square and its product with
    /// the field `h`.
    #[inline(always)]
    fn by_stop_mm(&self, r2: f64, along: f64, h: DVec2) -> f64 {
        (self.spherical_mm + self.secondary_spherical_mm * r2) * r2
            + 2.0 * self.coma_mm * along
            + self.field_curvature_mm * h.length_squared()
    }

    /// Change of the shift along x with the place in the stop along x, and the same along y.
    #[inline(always)]
    pub(crate) fn slope(&self, chief_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        let (u, h) = (self.per_half * aperture_mm, self.per_corner * chief_mm);
        let r2 = u.length_squared();
        let both = self.by_stop_mm(r2, u.dot(h), h);
        let each = 2.0 * (self.spherical_mm + 2.0 * self.secondary_spherical_mm * r2) * u * u
            + 4.0 * self.coma_mm * u * h
            + self.astigmatism_mm * h * h;
        self.per_half * (both + each)
    }

    /// Upper bound of the change of a shift, mm, by a mm of the field: at the corner, through the rim.
    pub(crate) fn by_field(&self) -> f64 {
        let second = self.astigmatism_mm.abs() + self.field_curvature_mm.abs();
        self.per_corner * (3.0 * self.coma_mm.abs() + 2.0 * second)
    }
}

impl Camera {
    /// Refuses aberrations that are not finite, and a kind that moves rays by more than two lenslets: two doublets at
    /// f/4 and a magnification of 0.5 move them by 1.2.
    pub(super) fn check_aberrations(&self) -> Result<(), Refusal> {
        let Some(terms) = self.aberrations else { return Ok(()) };
        let Aberrations { spherical_px, secondary_spherical_px, coma_px, coma_px_per_mm, .. } = terms;
        let most_px = 2.0 * self.pitch_px();
        let wanted = || format!("wanted at most two lenslets, {most_px:.2} px");
        let check = |(key, px): (&str, f64)| {
            let key = format!("aberrations.{key}");
            finite(&key, &[px])?;
            Refusal::unless(px.abs() <= most_px, || format!("{key} is {px}"), wanted())
        };
        finite("aberrations.spherical_px", &[spherical_px])?;
        finite("aberrations.secondary_spherical_px", &[secondary_spherical_px])?;
        // The two terms may balance each other. They move rays most at the rim, or where the growth of both ends.
        let turning = (-0.6 * spherical_px / secondary_spherical_px).clamp(0.0, 1.0);
        for square in [1.0, turning].into_iter().filter(|square| !square.is_nan()) {
            let px = (spherical_px + secondary_spherical_px * square) * square * square.sqrt();
            let moved = || format!("spherical_px with secondary_spherical_px in aberrations moves rays by {px:.1} px");
            Refusal::unless(px.abs() <= most_px, moved, wanted())?;
        }
        let rest = [
            ("coma_px", coma_px),
            ("coma_px_per_mm", coma_px_per_mm),
            ("astigmatism_px", terms.astigmatism_px),
            ("field_curvature_px", terms.field_curvature_px),
        ];
        rest.into_iter().try_for_each(check)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Optics;
    use crate::camera::{Aperture, Layout, tests::seed};

    /// A camera with some aberrations, whose corner is 3-4-5 px from the axis.
    fn camera(aberrations: Aberrations) -> Camera {
        let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
        (camera.sensor.width, camera.sensor.height) = (400, 300);
        camera.aberrations = Some(aberrations);
        camera
    }

    /// One ray of each term by hand. The chief ray goes to the right, half way to the corner: h = (0.5, 0). The ray
    /// passes the stop of half width 50 mm at u = (0.6, 0.8), so r = 1 and u h = 0.3.
    #[test]
    fn a_ray_of_each_term_by_hand() {
        let none = Aberrations::default();
        let cases = [
            (Aberrations { spherical_px: 1.0, ..none }, [0.6, 0.8]),
            // 2 (0.6, 0.8) 0.3 + (0.5, 0) 1.
            (Aberrations { coma_px: 1.0, ..none }, [0.36 + 0.5, 0.48]),
            // (0.5, 0) 0.3.
            (Aberrations { astigmatism_px: 1.0, ..none }, [0.15, 0.0]),
            // (0.6, 0.8) 0.25.
            (Aberrations { field_curvature_px: 1.0, ..none }, [0.15, 0.2]),
            // At the rim like spherical_px; see the next test.
            (Aberrations { secondary_spherical_px: 1.0, ..none }, [0.6, 0.8]),
        ];
        let (object, aperture) = (DVec2::new(125.0 * 0.0055, 0.0), DVec2::new(30.0, 40.0));
        let straight = Optics::new(&camera(none));
        for (aberrations, wanted_px) in cases {
            let optics = Optics::new(&camera(aberrations));
            let shift = |object, aperture| {
                let hit = |optics: &Optics| optics.array_from_object(object, 0.0, aperture);
                (hit(&optics) - hit(&straight)) / 0.0055
            };
            let found = shift(object, aperture);
            assert!(found.distance(wanted_px.into()) < 1e-9, "{aberrations:?}: {found}");
            assert!(shift(object, DVec2::ZERO).length() < 1e-9, "{aberrations:?}: the chief ray stays");
        }
    }

    #[test]
    fn further_terms_by_hand() {
        let none = Aberrations::default();
        let shift_px = |terms, z_mm, aperture| {
            let rays = RayAberrations::new(&camera(terms)).unwrap().at(z_mm);
            rays.shift_mm(DVec2::new(250.0 * 0.0055, 0.0), aperture) / 0.0055
        };
        // Half way to the rim the primary term has 1/8 of its size, and the secondary one 1/32.
        let half = DVec2::new(25.0, 0.0);
        let found = shift_px(Aberrations { spherical_px: -0.25, secondary_spherical_px: 1.0, ..none }, 0.0, half);
        assert!(found.length() < 1e-12, "{found}");
        let found = shift_px(Aberrations { secondary_spherical_px: 1.0, ..none }, 0.0, half);
        assert!(found.distance(DVec2::new(1.0 / 32.0, 0.0)) < 1e-12, "{found}");
        // At 4 mm, 2 - 4 0.5 is no coma.
        let coma = Aberrations { coma_px: 2.0, coma_px_per_mm: -0.5, ..none };
        assert!(shift_px(coma, 4.0, half).length() < 1e-12);
        assert!(shift_px(coma, 0.0, half).distance(DVec2::new(1.5, 0.0)) < 1e-12);
    }

    #[test]
    fn the_slope_is_that_of_the_shift() {
        let camera = camera(Aberrations {
            spherical_px: 1.0,
            secondary_spherical_px: -1.3,
            coma_px: -0.7,
            coma_px_per_mm: 0.2,
            astigmatism_px: 0.5,
            field_curvature_px: 2.0,
        });
        let rays = RayAberrations::new(&camera).unwrap().at(-1.5);
        let (chief, aperture) = (DVec2::new(0.4, -0.7), DVec2::new(21.0, 13.0));
        let by = |step: DVec2| (rays.shift_mm(chief, aperture + step) - rays.shift_mm(chief, aperture - step)) / 2e-3;
        let by_hand = DVec2::new(by(DVec2::X * 1e-3).x, by(DVec2::Y * 1e-3).y);
        assert!(rays.slope(chief, aperture).distance(by_hand) < 1e-9);
    }

    #[test]
    fn terms_come_back_and_are_checked() {
        let one = Aberrations { coma_px: 0.25, ..Aberrations::default() };
        let camera = camera(one);
        assert_eq!(Camera::from_json(&camera.to_json()).unwrap(), camera);
        assert_eq!((camera.bends(), camera.has_bent_rays()), (Some("aberrations"), true));
        let with = |aberrations| Camera { aberrations: Some(aberrations), ..camera.clone() };
        for (px, found) in [(f64::NAN, "aberrations.coma_px has the number NaN"), (-29.0, "aberrations.coma_px is -29")]
        {
            assert_eq!(with(Aberrations { coma_px: px, ..one }).check().unwrap_err().found, found);
        }
        // Terms that balance each other at the rim move rays half way to it.
        let balanced = |px: f64| Aberrations { spherical_px: -px, secondary_spherical_px: px, ..one };
        with(balanced(60.0)).check().unwrap();
        let found = with(balanced(200.0)).check().unwrap_err().found;
        assert!(found.contains("moves rays by -37.2 px"), "{found}");
    }
}
