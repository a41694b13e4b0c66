//! A camera as the images of particles see it.

use super::pictures::Pictures;
use super::sensor_blur::SensorBlur;
use crate::Optics;
use glam::DVec2;
use std::sync::Arc;

/// Rays, lenslets and stop.
#[derive(Debug, Clone)]
pub(super) struct View {
    pub(super) optics: Optics,
    /// Half sides of the box around a cell, mm.
    pub(super) corner: DVec2,
    /// Largest distance of a cell's corner from its middle, mm.
    pub(super) cell_radius: f64,
    pub(super) pitch_mm: f64,
    pub(super) has_round_stop: bool,
    /// Area of the stop, mm^2.
    pub(super) stop_mm2: f64,
    /// Pictures of the cell; None for a sharp sensor.
    pub(super) pictures: Option<Arc<Pictures>>,
    /// Whether pictures serve only lenslets of which the stop cuts nothing.
    pub(super) is_exact: bool,
    /// Blur of the sensor; None for a sharp one.
    pub(super) blur: Option<SensorBlur>,
}

impl View {
    /// How far fringes are followed beside a cell's shadow, px.
    #[inline(always)]
    pub(super) fn fringes_px(&self) -> f64 {
        self.pictures.as_ref().map_or(0.0, |pictures| pictures.fringes_px())
    }

    /// How far beside the rim of the stop waves are followed, px, where a mm has a shadow of this width, px.
    #[inline(always)]
    pub(super) fn rim_px(&self, growth: f64) -> f64 {
        let waves = self.pictures.as_ref().and_then(|pictures| pictures.waves.as_ref());
        waves.map_or(0.0, |cell| cell.rim_px(growth.abs() * self.pitch_mm))
    }

    /// Whether pictures follow waves: then no other image does.
    #[inline(always)]
    pub(super) fn follows_waves(&self) -> bool {
        self.pictures.as_ref().is_some_and(|pictures| pictures.waves.is_some())
    }
}
