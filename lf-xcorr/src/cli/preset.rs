//! The options that `--preset` sets, and their defaults. New measurements change them here and nowhere else.

use super::words::When;
use lf_core::cli::{Preset, word};
use lf_xcorr::Options;

/// The options that a preset sets.
pub struct Values {
    pub overlap: f64,
    pub deform: When,
    pub repeats: usize,
}

/// Without a preset. The overlap is the paper's.
pub const DEFAULT: Values = Values { overlap: 0.75, deform: When::Auto, repeats: Options::REPEATS };

/// An eighth of the vectors. Deformation costs a quarter of the time and divides the error of u by three and more.
const FAST: Values = Values { overlap: 0.5, deform: When::Auto, repeats: 3 };

/// All presets set the same: neither more vectors nor more repeats reduced the error.
pub fn values(preset: Preset) -> &'static Values {
    preset.of([&FAST, &FAST, &FAST])
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

pub fn help(preset: Preset) -> String {
    preset.help(&values(preset).typed())
}
