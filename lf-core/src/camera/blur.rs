//! Blur of the image on the sensor: diffraction at the lenslets, and a Gaussian for everything else.

use super::model::{Camera, LensletPattern};
use crate::lattice::Layout;
use glam::DVec2;
use std::f64::consts::PI;

/// Key of the index in `calibration.nominal`.
pub const STANDS_FOR: &str = "stands_in_air_for_index";

/// Diffraction pattern of a lenslet on the sensor, which in collimated light sees the far field of the lenslet's cell:
/// a square with its sides along the axes of the lattice, or a hexagon with two of its sides across the x axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Diffraction {
    /// Layout of the lattice, which gives the cell its shape.
    pub layout: Layout,
    /// `lambda g / p`, px.
    pub unit_px: f64,
}

impl Diffraction {
    /// Standard deviation of the Gaussian that stands for the middle of the pattern, px. Of 0.30 to 0.46 times the unit
    /// these leave [`crate::halo`] the smallest error at worst, for units of 0.2 to 1.8 px.
    pub fn core_px(&self) -> f64 {
        match self.layout {
            Layout::Square => 0.36 * self.unit_px,
            Layout::Hexagonal => 0.40 * self.unit_px,
        }
    }

    /// Transfer of the pattern at a frequency along the axes of the lattice, 1/px: the overlap of the lenslet's cell
    /// with itself when it is moved.
    pub fn transfer(&self, frequency: DVec2) -> f64 {
        // Two parallel sides, `across` from each other, keep a strip of this width.
        let strip = |across: DVec2| (1.0 - self.unit_px * across.dot(frequency).abs()).max(0.0);
        match self.layout {
            Layout::Square => strip(DVec2::X) * strip(DVec2::Y),
            Layout::Hexagonal => {
                let mut strips = [0.0, 1.0, 2.0].map(|side| strip(DVec2::from_angle(side * PI / 3.0)));
                strips.sort_by(f64::total_cmp);
                // The widest strip cuts two corners off the parallelogram of the others.
                let [a, b, widest] = strips;
                (4.0 * a * b - (a + b - widest).max(0.0).powi(2)) / 3.0
            }
        }
    }
}

impl Camera {
    /// The wavelength that stands in this camera for light of a wavelength in air, nm. A camera that stands in air for
    /// one before a liquid (`lf-calib nominal --water`) has lenslets whose focal lengths are longer by the liquid's
    /// index, but spots that are as small as before. `calibration.nominal` names the index.
    pub fn wavelength_of_nm(&self, in_air_nm: f64) -> f64 {
        in_air_nm / self.stands_for_index()
    }

    /// The index of the liquid that this camera stands in air for; 1 without one.
    pub fn stands_for_index(&self) -> f64 {
        let of = |calibration: &serde_json::Value| calibration["nominal"][STANDS_FOR].as_f64();
        self.calibration.as_ref().and_then(of).filter(|index| *index > 0.0).unwrap_or(1.0)
    }

    /// The diffraction pattern of a lenslet; None without a wavelength.
    pub fn diffraction(&self) -> Option<Diffraction> {
        let wavelength_mm = self.blur?.wavelength_nm? * 1e-6;
        let per_aperture = wavelength_mm * self.gap_mm() / self.sensor.pixel_pitch_mm;
        Some(Diffraction { layout: self.microlenses.layout, unit_px: per_aperture / self.microlenses.pitch_mm })
    }

    /// The diffraction pattern of a lenslet, where a particle's light makes Fresnel's.
    pub fn fresnel(&self) -> Option<Diffraction> {
        self.diffraction().filter(|_| self.blur.is_some_and(|blur| blur.pattern == Some(LensletPattern::Fresnel)))
    }

    /// Standard deviation of the Gaussian that fits the middle of the whole blur, px; 0 for a sharp camera.
    pub fn blur_core_px(&self) -> f64 {
        let diffraction = self.diffraction().map_or(0.0, |pattern| pattern.core_px());
        self.blur.map_or(0.0, |blur| blur.sigma_px).hypot(diffraction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The transfer against the cell and the cell moved, counted on a grid of points.
    #[test]
    fn transfer_is_the_overlap_of_cells() {
        let steps = 800;
        let points = || (0..steps * steps).map(|n| DVec2::new((n % steps) as f64, (n / steps) as f64) / 600.0 - 0.667);
        for (layout, angles) in [(Layout::Square, [0.0, 90.0, 90.0]), (Layout::Hexagonal, [0.0, 60.0, 120.0])] {
            let inside =
                |at: DVec2| angles.iter().all(|a: &f64| at.dot(DVec2::from_angle(a.to_radians())).abs() <= 0.5);
            let whole = points().filter(|at| inside(*at)).count() as f64;
            let pattern = Diffraction { layout, unit_px: 0.5 };
            for moved in [(0.0, 0.0), (0.1, 0.2), (0.5, -0.1), (0.3, 0.7), (-0.9, 0.05), (0.05, 0.99), (1.1, 0.3)] {
                let moved = DVec2::from(moved);
                let overlap = points().filter(|at| inside(*at) && inside(*at - moved)).count() as f64 / whole;
                let transfer = pattern.transfer(moved / 0.5);
                assert!((transfer - overlap).abs() < 4e-3, "{layout:?} {moved}: {transfer} {overlap}");
            }
        }
    }
}
