//! What `--preset` sets. Measured again, it is changed here and nowhere else.

use crate::ScoreName;
use lf_core::cli::{Preset, word};

/// What one preset sets.
pub struct Values {
    /// Pixels per voxel along x, y, z.
    pub pvr: [f64; 3],
    /// How the pixels of a voxel become its score.
    pub score: ScoreName,
}

/// Large voxels: less to keep, to reconstruct and to correlate.
const FAST: Values = Values { pvr: [2.0, 2.0, 20.0], score: ScoreName::Quantile };

/// The paper's voxels, which are the default, and a score that keeps fewer of them.
const BALANCED: Values = Values { pvr: [1.0, 1.0, 10.0], score: ScoreName::Quantile };

/// Finer in depth, where the error is.
const ACCURATE: Values = Values { pvr: [1.0, 1.0, 5.0], score: ScoreName::Quantile };

/// What a preset sets.
pub fn values(preset: Preset) -> &'static Values {
    preset.of([&FAST, &BALANCED, &ACCURATE])
}

impl Values {
    /// Its options, as they would be typed.
    pub fn typed(&self) -> [String; 2] {
        let [x, y, z] = self.pvr;
        [format!("--pvr {x},{y},{z}"), format!("--score {}", word(&self.score))]
    }
}

/// Its line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
