//! What `--preset` sets. Measured again, it is changed here and nowhere else.

use super::arguments::When;
use clap::ValueEnum;
use lf_core::cli::Preset;

/// What one preset sets.
pub struct Values {
    /// Share of a window that the next one covers too.
    pub overlap: f64,
    /// When the volumes are deformed.
    pub deform: When,
    /// How often the last pass is done at most; without deformation it is done once.
    pub repeats: usize,
}

/// An eighth of the vectors. Deformation costs a quarter of the time and divides the error of u by three and more.
const FAST: Values = Values { overlap: 0.5, deform: When::Auto, repeats: 3 };

/// The same: neither more vectors nor more repeats lessened the error.
const BALANCED: Values = FAST;

/// The same.
const ACCURATE: Values = FAST;

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
    preset.help(&values(preset).typed())
}
