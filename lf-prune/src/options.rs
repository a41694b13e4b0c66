//! The options of pruning.

use std::ops::Range;

/// How the pixels of a voxel become its score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Score {
    /// Geometric mean of the pixels over the brightest pixel. Forgives a few dark pixels among many.
    Geometric,
    /// Share of the pixels that reach the threshold. A voxel is kept if all but this share do. With 0 the darkest pixel
    /// decides; a larger share is a low quantile, which a few dead or noisy pixels cannot change.
    Share(f64),
}

/// Which voxels are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// How a voxel is scored.
    pub score: Score,
    /// Least geometric mean, or least brightness of a bright pixel, as a share of the image's brightest.
    pub threshold: f64,
    /// Least brightness that a pixel counts with in a geometric mean, as a share of the brightest. So one dark pixel
    /// costs a voxel a factor of `dark^(1/sections)` and not everything. Use the noise if there is any.
    pub dark: f64,
    /// Keep every voxel that can be seen, for any score.
    pub keep_all: bool,
    /// Sections of the aperture a side, each a ray of a voxel; None for the pixels under a lenslet. Fewer sections are
    /// faster and keep more: a voxel has fewer pixels that can speak against it.
    pub sections: Option<usize>,
}

/// The usual [`Options::dark`], for an image without noise.
pub const DARK: f64 = 1e-6;

/// The voxels of a slice that are scored, along x and y.
pub type Region = [Range<usize>; 2];
