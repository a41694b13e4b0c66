//! The values of `--preset`, for --method subsets. Change them here, and nowhere else, when they are measured again.

use super::names::BasisName;
use lf_core::cli::{Preset, word};

/// The values of one preset.
pub struct Values {
    /// Most sweeps over all pixels.
    pub iterations: usize,
    /// When to end sooner, as it would be typed.
    pub until: &'static str,
    /// The basis. Blobs of the default's width give the best Q, but larger errors in displacement.
    pub basis: BasisName,
}

/// Few sweeps and no blob: vectors hardly gain by more.
const FAST: Values = Values { iterations: 3, until: "stall", basis: BasisName::Point };

/// Enough sweeps for vectors that hardly improve further.
const BALANCED: Values = Values { iterations: 5, until: "stall", basis: BasisName::Point };

/// Voxels with their width, and sweeps until vectors improve no further.
const ACCURATE: Values = Values { iterations: 10, until: "stall", basis: BasisName::Box };

/// The values of a preset.
pub fn values(preset: Preset) -> &'static Values {
    preset.of([&FAST, &BALANCED, &ACCURATE])
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
