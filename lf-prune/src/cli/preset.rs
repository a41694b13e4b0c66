//! The values of `--preset`. Change them here, and nowhere else, when they are measured again.

use super::score_name::ScoreName;
use lf_core::cli::{Preset, word};

/// The values of one preset.
pub struct Values {
    /// Pixels per voxel along x, y, z.
    pub pvr: [f64; 3],
    /// How the pixels of a voxel become its score.
    pub score: ScoreName,
}

/// Large voxels: fewer to keep, to reconstruct and to correlate.
const FAST: Values = Values { pvr: [2.0, 2.0, 20.0], score: ScoreName::Quantile };

/// The paper's voxels, which are the default, and a score that keeps fewer of them.
const BALANCED: Values = Values { pvr: [1.0, 1.0, 10.0], score: ScoreName::Quantile };

/// Finer in depth, where the error is largest.
const ACCURATE: Values = Values { pvr: [1.0, 1.0, 5.0], score: ScoreName::Quantile };

/// The values of a preset.
pub fn values(preset: Preset) -> &'static Values {
    preset.of([&FAST, &BALANCED, &ACCURATE])
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
