//! What `--preset` sets. Measured again, it is changed here and nowhere else.

use super::arguments::When;
use clap::ValueEnum;
use lf_core::cli::{Preset, preset_help};

/// What one preset sets.
pub struct Values {
    /// Share of a window that the next one covers too.
    pub overlap: f64,
    /// When the volumes are deformed.
    pub deform: When,
    /// How often the last pass is done at most; without deformation it is done once.
    pub repeats: usize,
    /// Where it stands in time and error, for the help; empty until it is measured.
    measured: &'static str,
}

/// An eighth of the vectors, each measured once.
const FAST: Values = Values { overlap: 0.5, deform: When::Never, repeats: 1, measured: "" };

/// All vectors; steep gradients are followed some way.
const BALANCED: Values = Values { overlap: 0.75, deform: When::Auto, repeats: 3, measured: "" };

/// Until the vectors stand still: the default.
const ACCURATE: Values = Values { overlap: 0.75, deform: When::Auto, repeats: 6, measured: "" };

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
        let deform = self.deform.to_possible_value();
        let deform = deform.as_ref().map_or("", |word| word.get_name());
        [format!("--overlap {}", self.overlap), format!("--deform {deform}"), format!("--repeats {}", self.repeats)]
    }
}

/// Its line of the help.
pub fn help(preset: Preset) -> String {
    let values = values(preset);
    preset_help(&values.typed(), values.measured)
}
