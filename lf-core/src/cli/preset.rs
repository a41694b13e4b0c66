//! `--preset`: defaults that were measured together, under the same three names in every tool that has them.

use super::session::Session;
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};

/// A set of defaults between speed and accuracy. What an option is typed as comes before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// Least time.
    Fast,
    /// Between the two.
    Balanced,
    /// Least error.
    Accurate,
}

/// The word that a value is typed as.
pub fn word(value: &impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

impl Preset {
    /// What this one has of what the three have, the fastest first.
    pub fn of<T>(self, [fast, balanced, accurate]: [T; 3]) -> T {
        match self {
            Self::Fast => fast,
            Self::Balanced => balanced,
            Self::Accurate => accurate,
        }
    }

    /// Its line of a tool's help: what it sets there, as it would be typed, and its place on the front.
    pub fn help(self, sets: &[String]) -> String {
        format!("{}; {}", sets.join(" "), self.measured())
    }

    /// Its place on the front of time and error: all three tools with it, on a pair of frames of the trade's scene, one
    /// thread, 448 x 448 x 91 voxels at 1,1,10. `make -f scripts/paper/paper.mk trade` measures it.
    fn measured(self) -> &'static str {
        self.of([
            "the chain with it: 0.44 s a pair, RMS errors 0.16 px in u and 1.5 px in w",
            "1.9 s, 0.054 px and 0.52 px",
            "5.0 s, 0.040 px and 0.31 px",
        ])
    }

    /// The parser of a tool's `--preset`, whose help says by `help` what each sets.
    pub fn parser(help: fn(Self) -> String) -> impl TypedValueParser<Value = Self> {
        let value = |preset: &Self| Some(preset.to_possible_value()?.help(help(*preset)));
        PossibleValuesParser::new(Self::value_variants().iter().filter_map(value))
            .try_map(|name| Self::from_str(&name, false))
    }
}

impl Session {
    /// Tells with `--verbose` what a preset set: its options as they would be typed, each with whether it is heeded,
    /// which it is not where something typed comes before it.
    pub fn explain_preset(&self, preset: Preset, sets: impl IntoIterator<Item = (String, bool)>) {
        let (heeded, left): (Vec<_>, Vec<_>) = sets.into_iter().partition(|(_, heeded)| *heeded);
        let [heeded, left] = [heeded, left].map(|sets| {
            let sets: Vec<String> = sets.into_iter().map(|(set, _)| set).collect();
            sets.join(" ")
        });
        let heeded = if heeded.is_empty() { "nothing" } else { &heeded };
        let left = if left.is_empty() { left } else { format!("; what is typed comes before its {left}") };
        self.explain(format!("preset {} sets {heeded}{left}", word(&preset)));
    }
}
