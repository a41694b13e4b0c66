//! The words that options take, and the values of `--preset` for --method subsets.

use clap::ValueEnum;
use lf_core::cli::Preset;

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum WeightsName {
    /// Geometric optics without sampling
    Exact,
    /// The paper's dense ray tracing: n x n sections of the aperture, one beam and one chief ray each
    Drt,
    /// Tomographic PIV's: a sphere for the voxel, a cylinder for the pixel's line of sight
    Sphere,
}

#[derive(Clone, Copy, ValueEnum)]
pub enum BasisName {
    /// The voxel's centre
    Point,
    /// The voxel's width in x and y
    Box,
    /// A Gaussian particle image; the volume written is the sum of the blobs
    Blob,
}

/// The sweeps of a preset. Balanced and accurate have the default's; lf-prune makes accurate's voxels finer in depth.
/// With fewer than fast's, the error of w is more than 1.3 times the default's on some cameras.
pub fn iterations(preset: Preset) -> usize {
    preset.of([10, 20, 20])
}

/// The options that a preset sets, as they would be typed.
pub fn typed(preset: Preset) -> [String; 1] {
    [format!("--iterations {}", iterations(preset))]
}

/// The preset's line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&typed(preset))
}
