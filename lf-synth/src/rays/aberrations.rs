//! Aberrations of the main lens, by the textbook's shifts along the field's direction and across it (Welford 1986).

use glam::DVec2;
use lf_core::{Camera, camera};

/// The aberrations of a camera.
#[derive(Debug)]
pub(super) struct Aberrations {
    terms: camera::Aberrations,
    pixel_pitch_mm: f64,
    /// Half width of the stop, mm.
    rim_mm: f64,
    /// Distance of the sensor's corner from the axis, mm.
    corner_mm: f64,
}

impl Aberrations {
    /// None without the camera's block.
    pub(super) fn new(camera: &Camera) -> Option<Self> {
        let pixel_pitch_mm = camera.sensor.pixel_pitch_mm;
        let corner_px = 0.5 * (camera.sensor.width as f64).hypot(camera.sensor.height as f64);
        let rim_mm = 0.5 * camera.aperture_mm();
        camera.aberrations.map(|terms| Self { terms, pixel_pitch_mm, rim_mm, corner_mm: corner_px * pixel_pitch_mm })
    }

    /// The shift on the array, mm, of the ray of a point at depth `z_mm` through a place of the stop, for a chief ray
    /// that meets the array at `chief_mm`.
    #[inline(always)]
    pub(super) fn shift_mm(&self, z_mm: f64, chief_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        let camera::Aberrations { astigmatism_px, field_curvature_px, .. } = self.terms;
        let coma_px = self.terms.coma_px + self.terms.coma_px_per_mm * z_mm;
        if aperture_mm == DVec2::ZERO {
            return DVec2::ZERO;
        }
        // On the axis no direction is that of the field; any one gives the spherical aberration.
        let field = chief_mm.try_normalize().unwrap_or(DVec2::X);
        let height = chief_mm.length() / self.corner_mm;
        let (radius, angle) = (aperture_mm.length() / self.rim_mm, field.angle_to(aperture_mm));
        let spherical = self.terms.spherical_px * radius.powi(3) + self.terms.secondary_spherical_px * radius.powi(5);
        let square = coma_px * height * radius.powi(2);
        let along = spherical * angle.cos()
            + square * (2.0 + (2.0 * angle).cos())
            + (astigmatism_px + field_curvature_px) * height.powi(2) * radius * angle.cos();
        let across = spherical * angle.sin()
            + square * (2.0 * angle).sin()
            + field_curvature_px * height.powi(2) * radius * angle.sin();
        self.pixel_pitch_mm * (along * field + across * field.perp())
    }
}
