//! Blur of the image on the sensor: diffraction at the lenslets, and a Gaussian for everything else.

use super::model::Camera;
use crate::lattice::Layout;
use glam::DVec2;
use std::f64::consts::PI;

/// Diffraction pattern of a lenslet on the sensor, which sees the far field of the lenslet's cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Diffraction {
    /// A square cell: `sinc^2(x / unit) sinc^2(y / unit)` along the axes of the lattice.
    Square {
        /// `lambda g / p`, px.
        unit_px: f64,
    },
    /// A hexagonal cell, by the disc of equal area: the Airy pattern `(2 J1(pi r / unit) / (pi r / unit))^2`.
    Disc {
        /// `lambda g / diameter`, px.
        unit_px: f64,
    },
}

/// Standard deviation of the Gaussian that stands for the middle of a pattern, in its unit. Of 0.22 to 0.5 these leave
/// [`crate::halo`] the smallest error at worst, for patterns of 0.2 to 1.8 px.
const CORE_OF_SQUARE: f64 = 0.36;
const CORE_OF_DISC: f64 = 0.40;

impl Diffraction {
    /// Unit of the pattern, px.
    pub fn unit_px(&self) -> f64 {
        match self {
            Self::Square { unit_px } | Self::Disc { unit_px } => *unit_px,
        }
    }

    /// Standard deviation of the Gaussian that fits the middle of the pattern, px.
    pub fn core_px(&self) -> f64 {
        match self {
            Self::Square { unit_px } => CORE_OF_SQUARE * unit_px,
            Self::Disc { unit_px } => CORE_OF_DISC * unit_px,
        }
    }

    /// Transfer of the pattern at a frequency along the axes of the lattice, 1/px: the overlap of the lenslet's cell
    /// with itself when it is moved.
    pub fn transfer(&self, frequency: DVec2) -> f64 {
        match self {
            Self::Square { unit_px } => (1.0 - frequency.abs() * *unit_px).max(DVec2::ZERO).element_product(),
            Self::Disc { unit_px } => {
                let moved = (unit_px * frequency.length()).min(1.0);
                (moved.acos() - moved * (1.0 - moved * moved).sqrt()) * 2.0 / PI
            }
        }
    }
}

impl Camera {
    /// The diffraction pattern of a lenslet; None without a wavelength.
    pub fn diffraction(&self) -> Option<Diffraction> {
        let wavelength_mm = self.blur?.wavelength_nm? * 1e-6;
        let per_aperture = wavelength_mm * self.gap_mm() / self.sensor.pixel_pitch_mm;
        Some(match self.microlenses.layout {
            Layout::Square => Diffraction::Square { unit_px: per_aperture / self.microlenses.pitch_mm },
            Layout::Hexagonal => {
                let diameter_mm = (4.0 / PI * self.lattice().cell_area_mm2()).sqrt();
                Diffraction::Disc { unit_px: per_aperture / diameter_mm }
            }
        })
    }

    /// Standard deviation of the Gaussian that fits the middle of the whole blur, px; 0 for a sharp camera.
    pub fn blur_core_px(&self) -> f64 {
        let diffraction = self.diffraction().map_or(0.0, |pattern| pattern.core_px());
        self.blur.map_or(0.0, |blur| blur.sigma_px).hypot(diffraction)
    }
}
