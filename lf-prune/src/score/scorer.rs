//! The one choice of how voxels are scored, and its reason.

use super::lines::{Views, line_sums, straightened, tiles};
use super::slice::{Kept, Sections, Slice};
use super::{aligned, levels::Levels, rays};
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

    /// Whether it adds up lines of voxels, from views of the image.
    pub(crate) fn has_lines(self) -> bool {
        matches!(self, Self::Lines | Self::Tiles)
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
    scoring: Scoring,
    /// Exactly aligned if voxels are scored so.
    camera: Camera,
    views: Option<Views>,
}

impl<'a> Scorer<'a> {
    pub(crate) fn new(scoring: Scoring, levels: &'a Levels, sections: &'a Sections, camera: &Camera) -> Self {
        let views = scoring.has_lines().then(|| Views::new(levels, sections, camera));
        let camera = match scoring {
            Scoring::Aligned => camera.aligned().expect("chosen for an aligned camera"),
            _ => camera.clone(),
        };
        Self { levels, sections, scoring, camera, views }
    }

    /// The voxels kept of a region of slice `z`.
    pub(crate) fn slice(&self, grid: &Grid, z: usize, region: &Region) -> Kept {
        let slice = Slice { levels: self.levels, sections: self.sections, grid, z, region };
        match (&self.views, self.scoring) {
            (None, Scoring::Aligned) => aligned::slice(&slice, &self.camera),
            (None, _) => rays::slice(&slice, &self.camera),
            (Some(views), Scoring::Tiles) => tiles::slice(&slice, &self.camera, views),
            (Some(views), _) => line_sums::slice(&slice, views, DVec2::ZERO),
        }
    }
}
