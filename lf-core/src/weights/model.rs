//! Settings of the weights: the model of the optics, the meaning of a voxel, and the sections of the aperture.

use crate::{Refusal, camera::Camera};
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
    /// Tomographic PIV's, for comparison: a sphere for the voxel, a cylinder for a pixel's line of sight. It ignores
    /// the [`Basis`].
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
        /// Standard deviation in voxels along x and y.
        sigma_vox: f64,
    },
}

/// Sections of the aperture a side in the paper: the pixels under a lenslet.
pub fn aperture_sections(camera: &Camera) -> usize {
    (camera.pitch_px().round() as usize).max(1)
}

/// Numbers of sections a side that a user may ask for.
pub const SECTIONS: RangeInclusive<usize> = 2..=64;

/// Sections of the aperture a side: the number asked for, or [`aperture_sections`].
///
/// # Errors
/// If the number asked for is outside [`SECTIONS`].
pub fn sections(camera: &Camera, asked: Option<usize>) -> Result<usize, Refusal> {
    let Some(sections) = asked else { return Ok(aperture_sections(camera)) };
    if SECTIONS.contains(&sections) {
        return Ok(sections);
    }
    let found = format!("{sections} sections of the aperture a side");
    Err(Refusal::new(found, format!("wanted {} to {}", SECTIONS.start(), SECTIONS.end())))
}
