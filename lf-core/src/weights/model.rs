//! Settings of the weights: the model, the meaning of a voxel, the sections of the aperture, depths and image rows.

use crate::{Camera, Grid, Optics, Refusal};
use std::ops::RangeInclusive;

/// How weights are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// Geometric optics without sampling.
    Exact,
    /// The paper's dense ray tracing: n x n sections of the aperture, one beam and one chief ray each. As `n` grows,
    /// the weights become the exact ones.
    Drt {
        /// n; None for the paper's number, [`aperture_sections`].
        sections: Option<usize>,
    },
    /// Tomographic PIV's, for comparison: a sphere for the voxel, a cylinder for a pixel. Ignores the [`Basis`].
    Sphere,
}

/// The meaning of a voxel, seen sideways. The weights are averaged over it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Basis {
    /// Its centre.
    Point,
    /// Its width in x and y.
    Box,
    /// A Gaussian particle image.
    Blob {
        /// Standard deviation along x and y, pixels at the focal plane (pixel pitch over magnification). Along z the
        /// light that is written has as many voxels as standard deviation.
        sigma_px: f64,
    },
}

/// Sections of the aperture a side in the paper: the pixels under a lenslet.
pub fn aperture_sections(camera: &Camera) -> usize {
    (camera.pitch_px().round() as usize).max(1)
}

/// Numbers of sections a side that a user may ask for.
pub const SECTIONS: RangeInclusive<usize> = 2..=64;

/// The sections a side that are asked for, or [`aperture_sections`]. Refuses a number outside [`SECTIONS`].
pub fn sections(camera: &Camera, asked: Option<usize>) -> Result<usize, Refusal> {
    let Some(sections) = asked else { return Ok(aperture_sections(camera)) };
    if SECTIONS.contains(&sections) {
        return Ok(sections);
    }
    let found = format!("{sections} sections of the aperture a side");
    Err(Refusal::new(found, format!("wanted {} to {}", SECTIONS.start(), SECTIONS.end())))
}

/// [`check_depth_mm`] for the first and last slice of a grid.
pub fn check_depth(camera: &Camera, grid: &Grid) -> Result<(), Refusal> {
    [0, grid.shape[2] - 1].into_iter().try_for_each(|z| check_depth_mm(camera, grid.centre_mm(2, z)))
}

/// Refuses a depth at the main lens or its window, or one where the image under a lenslet turns over.
pub fn check_depth_mm(camera: &Camera, z_mm: f64) -> Result<(), Refusal> {
    let refusal = |reason: String| {
        Err(Refusal::new(format!("depth {} mm {reason}", z_mm as f32), "wanted a volume that ends before the lens"))
    };
    if let Some(medium) = camera.medium.as_ref().filter(|medium| z_mm >= medium.window_z_mm) {
        return refusal(format!("is not before the window, which is at {} mm", medium.window_z_mm));
    }
    let lens_mm = camera.object_distance_mm();
    if z_mm >= 0.9 * lens_mm {
        return refusal(format!("is too near the main lens, which stands {lens_mm:.1} mm before the focal plane"));
    }
    if Optics::new(camera).alpha(z_mm) > 0.5 {
        return refusal("is too far from focus: light from there covers half the width of the stop".into());
    }
    Ok(())
}

/// Every `step`-th image row from `first` on; `step` is 1 or more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowSet {
    /// The first row, less than `step`.
    pub first: u32,
    /// Rows to the next.
    pub step: u32,
}

impl RowSet {
    /// All rows.
    pub const ALL: Self = Self { first: 0, step: 1 };

    /// Whether a row is in the set.
    #[inline]
    pub fn holds(self, row: u32) -> bool {
        row % self.step == self.first
    }

    /// For each row of an image of `rows` rows, and for the end, the first row of the set at or after it.
    pub(super) fn next_from(self, rows: usize) -> Vec<u32> {
        let ahead = |row: u32| (self.first + self.step - row % self.step) % self.step;
        (0..=rows as u32).map(|row| row + ahead(row)).collect()
    }
}
