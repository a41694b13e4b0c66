//! The common base of every path to the weights: camera, grid and model, and the slices and cells derived from them.

use super::cell::{self, Slab};
use super::model::{Basis, Model, aperture_sections};
use super::{axis::AxisOptics, blur::Blur};
use crate::{Camera, Grid, Optics, camera::Aperture, frame::sensor_axes};
use glam::DVec2;

#[derive(Debug, Clone)]
pub(crate) struct Geometry {
    pub(super) model: Model,
    basis: Basis,
    pub(super) grid: Grid,
    pub(super) optics: Optics,
    pub(super) slabs: Vec<Slab>,
    pub(super) has_round_stop: bool,
    /// The full square of the aperture over the area of the stop: turns products of shares into shares of the light.
    pub(super) scale: f32,
    pub(super) pitch_mm: f64,
    /// Sections of the aperture a side.
    pub(super) sections: usize,
    /// Whether there are as many sections as in the paper, whose squares on the sensor are as large as pixels.
    has_pixel_squares: bool,
}

impl Geometry {
    pub(super) fn new(camera: &Camera, grid: &Grid, model: Model, basis: Basis, sections: usize) -> Self {
        let optics = Optics::new(camera);
        let has_round_stop = camera.main_lens.aperture == Aperture::Circle;
        Self {
            model,
            basis,
            grid: grid.clone(),
            slabs: cell::slabs(camera),
            has_round_stop,
            scale: aperture_scale(model, has_round_stop, sections, optics.half_aperture_mm),
            optics,
            pitch_mm: camera.microlenses.pitch_mm,
            sections,
            has_pixel_squares: sections == aperture_sections(camera),
        }
    }

    /// The optics of slice `z` along x (0) or y (1) of the sensor.
    pub(super) fn axis(&self, z: usize, along: usize) -> AxisOptics {
        let z_mm = self.grid.centre_mm(2, z);
        let (array_gain, lenslet_gain) = self.optics.gains();
        let mut axis = AxisOptics {
            alpha: self.optics.alpha(z_mm),
            beta: self.optics.beta(z_mm),
            demagnification: self.optics.demagnification,
            array_gain,
            lenslet_gain,
            half_aperture: self.optics.half_aperture_mm,
            pixel_pitch: self.optics.pixel_pitch_mm,
            pixels: self.optics.sensor_px[along],
            sections: self.sections,
            square: 1.0,
        };
        // Departure: the paper's square is one pixel wide, which is the width of a section's light if there are as many
        // sections as pixels. For other numbers the square is as wide as a section's light: no gaps and no overlaps.
        if !self.has_pixel_squares {
            let (_, slope) = axis.sensor_line(0.0, 0.0);
            axis.square = slope.abs() * 2.0 * axis.half_aperture / axis.sections as f64;
        }
        axis
    }

    /// How a voxel of the slice of `axis` blurs along x and y, as seen on the array.
    pub(super) fn blurs(&self, axis: &AxisOptics) -> [Blur; 2] {
        [0, 1].map(|along| {
            let width = axis.beta * self.grid.spacing_mm[along];
            match self.basis {
                Basis::Point => Blur::None,
                Basis::Box => Blur::Box { half: 0.5 * width },
                Basis::Blob { sigma_px } => Blur::Gauss { sigma: axis.beta * sigma_px * self.focal_px_mm() },
            }
        })
    }

    /// A pixel at the focal plane: pixel pitch over magnification, mm.
    pub(super) fn focal_px_mm(&self) -> f64 {
        self.optics.pixel_pitch_mm / self.optics.beta(0.0)
    }

    /// Half sides of the box around a cell.
    pub(super) fn corner(&self) -> DVec2 {
        let corners = |slab: &Slab| [0, 1].map(|n| DVec2::new(slab.x[n], slab.y[n]).abs());
        self.slabs.iter().flat_map(corners).fold(DVec2::ZERO, DVec2::max)
    }

    /// Left and right edge of a cell at a height from its centre, mm.
    #[inline(always)]
    pub(super) fn edges_at(&self, height: f64) -> [f64; 2] {
        let slab = self.slabs.iter().find(|slab| height < slab.y[1]).or(self.slabs.last());
        slab.map_or([0.0; 2], |slab| slab.x)
    }

    /// Where the chief ray of a voxel meets the array, mm.
    #[inline(always)]
    pub(super) fn chief_mm(&self, axis: &AxisOptics, [x, y, z]: [usize; 3]) -> DVec2 {
        let place = DVec2::new(self.grid.centre_mm(0, x), self.grid.centre_mm(1, y));
        -axis.beta * sensor_axes(place) + self.optics.distortion_mm(place, self.grid.centre_mm(2, z))
    }
}

/// The full square of the aperture over the area of the stop; for sampled apertures, over the sections inside it.
fn aperture_scale(model: Model, has_round_stop: bool, sections: usize, half_aperture: f64) -> f32 {
    match (has_round_stop, model) {
        (false, _) => 1.0,
        (true, Model::Exact | Model::Sphere) => std::f32::consts::FRAC_1_PI * 4.0,
        (true, Model::Drt { .. }) => {
            let n = sections as f64;
            let centre = |i: usize| -half_aperture + (i as f64 + 0.5) * 2.0 * half_aperture / n;
            let inside = (0..sections * sections)
                .filter(|i| centre(i / sections).powi(2) + centre(i % sections).powi(2) <= half_aperture.powi(2))
                .count();
            (n * n / inside.max(1) as f64) as f32
        }
    }
}
