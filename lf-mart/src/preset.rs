//! What `--preset` sets, with --method subsets. Measured again, it is changed here and nowhere else.

use crate::BasisName;
use lf_core::cli::Preset;

/// What one preset sets.
pub struct Values {
    /// Sweeps over all pixels, at most.
    pub iterations: usize,
    /// When to end sooner, as typed.
    pub until: &'static str,
    /// What a voxel stands for.
    pub basis: BasisName,
    /// Standard deviation of a blob, voxels.
    pub blob: Option<f64>,
}

/// Few sweeps and no blob: vectors hardly gain by more, see the trade.
const FAST: Values = Values { iterations: 3, until: "stall", basis: BasisName::Point, blob: None };

/// Nearly all that sweeps give to a vector.
const BALANCED: Values = Values { iterations: 5, until: "stall", basis: BasisName::Point, blob: None };

/// Blobs narrower than the default's, which is best in Q, err least in displacement.
const ACCURATE: Values = Values { iterations: 60, until: "stall", basis: BasisName::Blob, blob: Some(0.4) };

/// What a preset sets.
pub fn values(preset: Preset) -> &'static Values {
    match preset {
        Preset::Fast => &FAST,
        Preset::Balanced => &BALANCED,
        Preset::Accurate => &ACCURATE,
    }
}

impl Values {
    /// Its options, as they would be typed.
    pub fn typed(&self) -> Vec<String> {
        let Self { iterations, until, basis, blob } = self;
        let mut typed = vec![
            format!("--iterations {iterations}"),
            format!("--until {until}"),
            format!("--basis {}", basis.name()),
        ];
        typed.extend(blob.map(|blob| format!("--blob {blob}")));
        typed
    }
}

/// Its line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
