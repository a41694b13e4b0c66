//! The options that `--preset` sets, and their defaults. New measurements change them here and nowhere else.

use super::words::When;
use lf_core::cli::{Preset, word};
use lf_xcorr::Options;

/// The options that a preset sets.
pub struct Values {
    /// Fraction of a window that the next one covers too.
    pub overlap: f64,
    /// When the volumes are deformed.
    pub deform: When,
    /// Most times that the last pass is done; without deformation it is done once.
    pub repeats: usize,
}

/// Without a preset. The overlap is the paper's.
pub const DEFAULT: Values = Values { overlap: 0.75, deform: When::Auto, repeats: Options::REPEATS };

/// An eighth of the vectors. Deformation costs a quarter of the time and divides the error of u by three and more.
const FAST: Values = Values { overlap: 0.5, deform: When::Auto, repeats: 3 };

/// The same values: neither more vectors nor more repeats reduced the error.
const BALANCED: Values = FAST;

/// The same values, for the same reason.
const ACCURATE: Values = FAST;

/// The options that a preset sets.
pub fn values(preset: Preset) -> &'static Values {
    preset.of([&FAST, &BALANCED, &ACCURATE])
}

impl Values {
    /// The options as they would be typed.
    pub fn typed(&self) -> [String; 3] {
        [
            format!("--overlap {}", self.overlap),
            format!("--deform {}", word(&self.deform)),
            format!("--repeats {}", self.repeats),
        ]
    }
}

/// The preset's line of the help.
pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
