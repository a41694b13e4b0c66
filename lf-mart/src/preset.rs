//! What `--preset` sets, with --method subsets. Measured again, it is changed here and nowhere else.

use lf_core::cli::{Preset, preset_help};

/// What one preset sets.
pub struct Values {
    /// Sweeps over all pixels, at most.
    pub iterations: usize,
    /// When to end sooner, as typed.
    pub until: &'static str,
    /// Standard deviation of a blob, voxels.
    pub blob: f64,
    /// Where it stands in time and error, for the help; empty until it is measured.
    measured: &'static str,
}

/// Few sweeps: a start is all that they make.
const FAST: Values = Values { iterations: 3, until: "stall", blob: 0.65, measured: "" };

/// The fewest sweeps after which the misfit stalls anywhere, about.
const BALANCED: Values = Values { iterations: 10, until: "stall", blob: 0.65, measured: "" };

/// Until the misfit stalls: the default.
const ACCURATE: Values = Values { iterations: 60, until: "stall", blob: 0.65, measured: "" };

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
    pub fn typed(&self) -> [String; 3] {
        let Self { iterations, until, blob, .. } = self;
        [format!("--iterations {iterations}"), format!("--until {until}"), format!("--blob {blob}")]
    }
}

/// Its line of the help.
pub fn help(preset: Preset) -> String {
    let values = values(preset);
    preset_help(&values.typed(), values.measured)
}
