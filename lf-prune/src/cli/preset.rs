//! The words of `--score`, and the values of `--preset`. These values stand only here.

use super::pvr::{self, Pvr, VoxelDepth};
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

/// Pixels per voxel of a preset. Accurate has finer voxels in depth, where the error is largest: it had the smallest
/// error of w on every camera that scripts/studies/presets reports. Larger voxels are much faster, but err two to three
/// times as much.
pub fn pvr(preset: Preset) -> Pvr {
    Pvr { depth: VoxelDepth::Resolution(preset.of([2.0, 2.0, 4.0])), ..pvr::DEFAULT }
}

/// The preset's line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&[typed(preset)])
}

/// The options of a preset, as they would be typed.
pub fn typed(preset: Preset) -> String {
    format!("--pvr {}", pvr(preset))
}
