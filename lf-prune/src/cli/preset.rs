//! The words of `--score`, and the values of `--preset`. Change these here, and nowhere else, when they are measured
//! again.

use super::pvr::{self, Depth, Pvr};
use clap::ValueEnum;
use lf_core::cli::Preset;

#[derive(Clone, Copy, ValueEnum)]
pub enum ScoreName {
    /// Geometric mean of the pixels
    Geometric,
    /// The darkest pixel
    Minimum,
    /// A low quantile of the pixels, which a few dead or noisy ones cannot change
    Quantile,
}

/// The values of one preset: pixels per voxel along x, y, z.
pub struct Values {
    pub pvr: Pvr,
}

/// Accurate has finer voxels in depth, where the error is largest: it had the least error of w on every camera that
/// scripts/studies/presets reports. Larger voxels are much faster, but err two to three times as much.
pub fn values(preset: Preset) -> Values {
    let parts = preset.of([2.0, 2.0, 4.0]);
    Values { pvr: Pvr { depth: Depth::Resolution(parts), ..pvr::DEFAULT } }
}

impl Values {
    /// The options, as they would be typed.
    pub fn typed(&self) -> [String; 1] {
        [format!("--pvr {}", self.pvr)]
    }
}

/// The preset's line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
