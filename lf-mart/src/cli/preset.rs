//! The words that options take, and the values of `--preset` for --method subsets. Change these here, and nowhere else,
//! when they are measured again.

use clap::ValueEnum;
use lf_core::cli::{Preset, word};

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

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum MethodName {
    /// Ordered subsets of simultaneous MART, with momentum
    Subsets,
    /// Simultaneous MART
    Smart,
    /// Maximum likelihood by expectation maximisation
    Mlem,
    /// The paper's row action: pixel after pixel, with stored weights
    Mart,
}

/// The values of one preset.
pub struct Values {
    /// Most sweeps over all pixels.
    pub iterations: usize,
    /// When to end sooner, as it would be typed.
    pub until: &'static str,
    /// Blobs of the default's width give the best Q, but larger errors in displacement.
    pub basis: BasisName,
}

/// Fast has few sweeps, and points: vectors hardly gain by more. Balanced ends when vectors hardly improve further.
/// Accurate has voxels with their width, and sweeps until vectors improve no further.
pub fn values(preset: Preset) -> Values {
    let (iterations, basis) = preset.of([(3, BasisName::Point), (5, BasisName::Point), (10, BasisName::Box)]);
    Values { iterations, until: "stall", basis }
}

impl Values {
    /// The options, as they would be typed.
    pub fn typed(&self) -> [String; 3] {
        let Self { iterations, until, basis } = self;
        [format!("--iterations {iterations}"), format!("--until {until}"), format!("--basis {}", word(basis))]
    }
}

/// The preset's line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
