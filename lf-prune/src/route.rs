//! Which way rays are followed, by what the camera has.

use crate::views::straightened;
use lf_core::camera::Camera;

/// A way to follow rays, the fastest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Route {
    /// Sums along columns and rows of pixels: a square lattice in line with them.
    InLine,
    /// Sums along lines of voxels: a turned or a hexagonal lattice.
    Lines,
    /// The same in tiles, in which rays are moved alike: departures from the lattice, distortion.
    Tiles,
    /// Ray by ray: a medium, a tilt, a gap.
    Rays,
}

impl Route {
    /// The fastest that follows the camera.
    pub fn of(camera: &Camera) -> Self {
        if camera.aligned().is_some() {
            return Self::InLine;
        }
        if straightened(camera).bends().is_some() {
            return Self::Rays;
        }
        if camera.centres.is_some() || camera.distortion.is_some() { Self::Tiles } else { Self::Lines }
    }

    /// What it is and costs, in words.
    pub fn about(self) -> &'static str {
        match self {
            Self::InLine => "sums along columns and rows, the fastest way",
            Self::Lines => "sums along lines of voxels, some twenty times as slow as the fastest way",
            Self::Tiles => "sums along lines of voxels in tiles, some hundred times as slow as the fastest way",
            Self::Rays => "ray by ray, the slowest way",
        }
    }
}
