//! How wide the lenslet images are, and the f-number that follows: the gap over the width.

use super::image_lattice::ImageLattice;
use lf_core::{Camera, camera::Aperture};

/// A measured f-number replaces the nominal one only if they differ by more than this share, and by more than this
/// number of standard uncertainties. Otherwise noise would be written into the camera.
const LEAST_CHANGE: f64 = 0.01;
const SIGMAS: f64 = 3.0;

/// Diameter (round stop) or side (square stop) of lenslet images, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fill {
    /// Measured at half of the light.
    pub measured_px: f64,
    /// Standard uncertainty of the measured one.
    pub uncertainty_px: f64,
    /// By the nominal f-number: k D.
    pub nominal_px: f64,
    /// Distance between lenslet images that they may fill: the pitch, for a square stop the distance between rows.
    pub pitch_px: f64,
    /// The nominal working f-number.
    pub nominal_f_number: f64,
}

impl Fill {
    /// None if no disc (or square) follows the edge of the lenslet images.
    pub(super) fn of(lattice: &ImageLattice, camera: &Camera) -> Option<Self> {
        let px_per_mm = (1.0 + camera.image_growth()) / camera.sensor.pixel_pitch_mm;
        let measured = match camera.main_lens.aperture {
            Aperture::Circle => lattice.disc?,
            Aperture::Square => lattice.square?,
        };
        Some(Self {
            measured_px: measured.width_px,
            uncertainty_px: measured.uncertainty_px,
            nominal_px: camera.stop_image_px(),
            pitch_px: free_pitch_mm(camera) * px_per_mm,
            nominal_f_number: camera.main_lens.working_f_number,
        })
    }

    /// The measured working f-number.
    pub fn f_number(&self) -> f64 {
        self.nominal_f_number * self.nominal_px / self.measured_px
    }

    /// Standard uncertainty of the measured working f-number.
    pub fn f_number_uncertainty(&self) -> f64 {
        self.f_number() * self.uncertainty_px / self.measured_px
    }

    /// Measured over nominal f-number, minus 1.
    pub fn change(&self) -> f64 {
        self.nominal_px / self.measured_px - 1.0
    }

    /// Whether the images show another f-number than the nominal one, beyond its uncertainty.
    pub fn is_other_stop(&self) -> bool {
        let apart = (self.measured_px / self.nominal_px - 1.0).abs();
        apart > LEAST_CHANGE && apart > SIGMAS * self.uncertainty_px / self.measured_px
    }

    /// The camera with the stop that the images show, if that differs from the camera's beyond its uncertainty.
    pub(super) fn with_stop(&self, camera: &mut Camera) {
        if self.is_other_stop() {
            camera.main_lens.working_f_number = self.f_number();
        }
    }
}

/// Width that a lenslet image may fill, mm on the array: the pitch for a round stop, the distance of rows for a square.
pub(super) fn free_pitch_mm(camera: &Camera) -> f64 {
    match camera.main_lens.aperture {
        Aperture::Circle => camera.microlenses.pitch_mm,
        Aperture::Square => camera.lattice().row_pitch_mm(),
    }
}
