//! The options of pruning.

use std::ops::Range;

/// How the pixels of a voxel become its score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Score {
    /// Geometric mean of the pixels, each limited to [`Options::dark`] and [`Options::bright`]. A few dark pixels take
    /// little from it, and a few bright ones give little.
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
    /// Least brightness that a pixel counts with in a geometric mean, as a share of the brightest: see
    /// [`DARK_THRESHOLDS`].
    pub dark: f64,
    /// Most brightness that a pixel counts with in a geometric mean, as a share of the brightest: see
    /// [`BRIGHT_THRESHOLDS`].
    pub bright: f64,
    /// Keep every voxel that can be seen, for any score.
    pub keep_all: bool,
    /// Sections of the aperture a side, each a ray of a voxel; None for the pixels under a lenslet. Fewer sections are
    /// faster and keep more: a voxel has fewer pixels that can speak against it.
    pub sections: Option<usize>,
}

/// The usual [`Options::dark`], thresholds. Then one dark ray of a voxel takes as much from it as six bright rays give:
/// a dead pixel or a shadow cannot veto a voxel.
pub const DARK_THRESHOLDS: f64 = 1.0 / 50.0;

/// The usual [`Options::bright`], thresholds. Where particle images overlap, voxels without a particle get some very
/// bright rays, which must not make up for their dark ones. `scripts/studies/study prune-cameras` shows what these two
/// limits keep and lose.
pub const BRIGHT_THRESHOLDS: f64 = 2.0;

/// The voxels of a slice that are scored, along x and y.
pub type Region = [Range<usize>; 2];
