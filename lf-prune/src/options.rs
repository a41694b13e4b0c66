//! The options of pruning.

/// How the pixels of a voxel become its score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Score {
    /// Geometric mean of the pixels, each limited to [`PruneOptions::dark`] and [`PruneOptions::bright`]. A few dark or
    /// bright pixels change it little.
    Geometric,
    /// Share of the pixels that reach the threshold. A voxel is kept if all but the given share do. With 0 the darkest
    /// pixel decides; a larger share is a low quantile, which a few dead or noisy pixels cannot change.
    Share(f64),
}

/// Which voxels are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PruneOptions {
    /// How a voxel is scored.
    pub score: Score,
    /// Smallest geometric mean kept, or brightness from which a pixel counts as bright; as a share of the image's
    /// brightest pixel.
    pub threshold: f64,
    /// Lower limit of a pixel's brightness in a geometric mean, as a share of the brightest: see [`DARK_THRESHOLDS`].
    pub dark: f64,
    /// Upper limit of a pixel's brightness in a geometric mean, as a share of the brightest: see [`BRIGHT_THRESHOLDS`].
    pub bright: f64,
    /// Keep every voxel that can be seen, whatever its score.
    pub keep_all: bool,
    /// Sections along a side of the aperture, each with one ray of a voxel; None for the number of pixels under a
    /// lenslet. Fewer sections are faster and keep more voxels, since fewer pixels can rule a voxel out.
    pub sections: Option<usize>,
}

/// The default [`PruneOptions::dark`], in thresholds. One dark ray of a voxel then costs as much as six bright rays
/// give, so a dead pixel or a shadow cannot veto a voxel.
pub const DARK_THRESHOLDS: f64 = 1.0 / 50.0;

/// The default [`PruneOptions::bright`], in thresholds. Where particle images overlap, voxels without a particle get
/// some very bright rays, which must not make up for their dark ones. `scripts/studies/study prune-cameras` shows what
/// these two limits keep and lose.
pub const BRIGHT_THRESHOLDS: f64 = 2.0;

/// The second pruning of a frame whose light the kept voxels do not explain: [`PruneOptions::dark`] in thresholds, and
/// the threshold as a share of the usual one. Four rays in ten may then be dark: a real lens shows some sections
/// elsewhere.
pub const FORGIVING: [f64; 2] = [0.35, 0.5];
