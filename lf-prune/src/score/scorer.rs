//! The one choice of how voxels are scored, and its reason.

use super::lines::{Views, line_sums, straightened, tiles};
use super::slice::{Kept, Slice};
use super::{aligned, levels::Levels, rays, sections::Sections};
use crate::options::Region;
use glam::DVec2;
use lf_core::{Camera, Grid};

/// A way to score voxels, the fastest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scoring {
    /// Sums along columns and rows of pixels, for a lattice that is aligned with them.
    Aligned,
    /// Sums along lines of voxels, for a turned or hexagonal lattice.
    Lines,
    /// The same in tiles over which rays shift alike, for distortion or departures from the lattice.
    Tiles,
    /// Ray by ray, for a medium, a tilt or a gap.
    Rays,
}

impl Scoring {
    /// The fastest way that follows the camera, and why it is not a faster one.
    pub(crate) fn choose(camera: &Camera) -> (Self, String) {
        let Some(reason) = camera.misalignment() else {
            return (Self::Aligned, "the lattice is aligned with the pixels".to_string());
        };
        let scoring = if straightened(camera).bends().is_some() {
            Self::Rays
        } else if camera.centres.is_some() || camera.distortion.is_some() {
            Self::Tiles
        } else {
            Self::Lines
        };
        (scoring, reason)
    }

    pub(crate) fn about(self) -> &'static str {
        match self {
            Self::Aligned => "sums along columns and rows, the fastest way",
            Self::Lines => "sums along lines of voxels, about twenty times as slow as the fastest way",
            Self::Tiles => "sums along lines of voxels in tiles, about a hundred times as slow as the fastest way",
            Self::Rays => "ray by ray, the slowest way",
        }
    }
}

/// Scores slices of voxels against an image.
pub(crate) struct Scorer<'a> {
    levels: &'a Levels<'a>,
    sections: &'a Sections,
    camera: &'a Camera,
    tables: Tables,
}

/// Made once for all slices. An aligned camera is made exactly aligned.
enum Tables {
    Aligned(Camera),
    Lines(Views),
    Tiles(Views),
    Rays,
}

impl<'a> Scorer<'a> {
    pub(crate) fn new(scoring: Scoring, levels: &'a Levels, sections: &'a Sections, camera: &'a Camera) -> Self {
        let tables = match scoring {
            Scoring::Aligned => Tables::Aligned(camera.aligned().expect("chosen for an aligned camera")),
            Scoring::Lines => Tables::Lines(Views::new(levels, sections, camera)),
            Scoring::Tiles => Tables::Tiles(Views::new(levels, sections, camera)),
            Scoring::Rays => Tables::Rays,
        };
        Self { levels, sections, camera, tables }
    }

    /// The voxels kept of a region of slice `z`.
    pub(crate) fn slice(&self, grid: &Grid, z: usize, region: &Region) -> Kept {
        let slice = Slice { levels: self.levels, sections: self.sections, grid, z, region };
        match &self.tables {
            Tables::Aligned(camera) => aligned::slice(&slice, camera),
            Tables::Lines(views) => line_sums::slice(&slice, views, DVec2::ZERO),
            Tables::Tiles(views) => tiles::slice(&slice, self.camera, views),
            Tables::Rays => rays::slice(&slice, self.camera),
        }
    }
}
