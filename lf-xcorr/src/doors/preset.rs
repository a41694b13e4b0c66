//! What `--preset` sets. Measured again, it is changed here and nowhere else.

use super::arguments::When;
use lf_core::cli::{Preset, word};

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
    preset.of([&FAST, &BALANCED, &ACCURATE])
}

impl Values {
    /// Its options, as they would be typed.
    pub fn typed(&self) -> [String; 3] {
        [
            format!("--overlap {}", self.overlap),
            format!("--deform {}", word(&self.deform)),
            format!("--repeats {}", self.repeats),
        ]
    }
}

/// Its line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
