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

    /// The shift on the array, mm, of the ray through a place of the stop, for a chief ray that meets the array at
    /// `chief_mm`.
    #[inline(always)]
    pub(super) fn shift_mm(&self, chief_mm: DVec2, aperture_mm: DVec2) -> DVec2 {
        let camera::Aberrations { spherical_px, coma_px, astigmatism_px, field_curvature_px } = self.terms;
        if aperture_mm == DVec2::ZERO {
            return DVec2::ZERO;
        }
        // On the axis no direction is that of the field; any one gives the spherical aberration.
        let field = chief_mm.try_normalize().unwrap_or(DVec2::X);
        let height = chief_mm.length() / self.corner_mm;
        let (radius, angle) = (aperture_mm.length() / self.rim_mm, field.angle_to(aperture_mm));
        let (cube, square) = (spherical_px * radius.powi(3), coma_px * height * radius.powi(2));
        let along = cube * angle.cos()
            + square * (2.0 + (2.0 * angle).cos())
            + (astigmatism_px + field_curvature_px) * height.powi(2) * radius * angle.cos();
        let across = cube * angle.sin()
            + square * (2.0 * angle).sin()
            + field_curvature_px * height.powi(2) * radius * angle.sin();
        self.pixel_pitch_mm * (along * field + across * field.perp())
    }
}
