//! What `--preset` sets, with --method subsets. Measured again, it is changed here and nowhere else.

use crate::BasisName;
use lf_core::cli::{Preset, word};

/// What one preset sets.
pub struct Values {
    /// Sweeps over all pixels, at most.
    pub iterations: usize,
    /// When to end sooner, as typed.
    pub until: &'static str,
    /// What a voxel stands for. Blobs as wide as the default's are best in Q, and err more in displacement.
    pub basis: BasisName,
}

/// Few sweeps and no blob: vectors hardly gain by more, see the trade.
const FAST: Values = Values { iterations: 3, until: "stall", basis: BasisName::Point };

/// Nearly all that sweeps give to a vector.
const BALANCED: Values = Values { iterations: 5, until: "stall", basis: BasisName::Point };

/// Voxels with their width, and all that sweeps give.
const ACCURATE: Values = Values { iterations: 10, until: "stall", basis: BasisName::Box };

/// What a preset sets.
pub fn values(preset: Preset) -> &'static Values {
    preset.of([&FAST, &BALANCED, &ACCURATE])
}

impl Values {
    /// Its options, as they would be typed.
    pub fn typed(&self) -> [String; 3] {
        let Self { iterations, until, basis } = self;
        [format!("--iterations {iterations}"), format!("--until {until}"), format!("--basis {}", word(basis))]
    }
}

/// Its line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
