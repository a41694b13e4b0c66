//! The words of `--score`, and the values of `--preset`. Change these here, and nowhere else, when they are measured
//! again.

use clap::ValueEnum;
use lf_core::cli::{Preset, word};

#[derive(Clone, Copy, ValueEnum)]
pub enum ScoreName {
    /// Geometric mean of the pixels
    Geometric,
    /// The darkest pixel
    Minimum,
    /// A low quantile of the pixels, which a few dead or noisy ones cannot change
    Quantile,
}

/// The values of one preset: pixels per voxel along x, y, z, and the score.
pub struct Values {
    pub pvr: [f64; 3],
    pub score: ScoreName,
}

/// Fast has large voxels: fewer to keep, to reconstruct and to correlate. Balanced has the paper's, which are the
/// default. Accurate is finer in depth, where the error is largest. The score keeps fewer voxels than the default one.
pub fn values(preset: Preset) -> Values {
    let pvr = preset.of([[2.0, 2.0, 20.0], [1.0, 1.0, 10.0], [1.0, 1.0, 5.0]]);
    Values { pvr, score: ScoreName::Quantile }
}

impl Values {
    /// The options, as they would be typed.
    pub fn typed(&self) -> [String; 2] {
        let [x, y, z] = self.pvr;
        [format!("--pvr {x},{y},{z}"), format!("--score {}", word(&self.score))]
    }
}

/// The preset's line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
