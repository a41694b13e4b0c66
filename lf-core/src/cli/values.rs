//! Values of options: lists of numbers, and `--preset`, three sets of measured defaults.

use super::session::Session;
use crate::image::Channel;
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};

/// Reads `N` finite numbers between commas; a value parser for clap, which adds the option to the error.
pub fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let values: Vec<f64> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
    let whole = text.split(',').count() == values.len();
    match <[f64; N]>::try_from(values) {
        Ok(values) if whole && values.iter().all(|v| v.is_finite()) => Ok(values),
        _ => Err(format!("wanted {N} numbers between commas")),
    }
}

/// How images are read; `#[command(flatten)]` it in the arguments of a tool that reads any.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct ImageOptions {
    /// Channel of colour images that counts as their light; without it, colour is refused unless all channels are equal
    #[arg(long, value_name = "CHANNEL", value_parser = channels())]
    pub channel: Option<Channel>,
}

fn channels() -> impl TypedValueParser<Value = Channel> {
    let find = |word: String| Channel::WORDS.into_iter().find(|(known, _)| *known == word).map(|(_, channel)| channel);
    PossibleValuesParser::new(Channel::WORDS.map(|(word, _)| word)).map(move |word| find(word).expect("a known word"))
}

/// A set of defaults between speed and accuracy. An option on the command line takes precedence over the preset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// Shortest time.
    Fast,
    /// A compromise.
    Balanced,
    /// Smallest error.
    Accurate,
}

/// The word for a value on the command line.
pub fn word(value: &impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

impl Preset {
    /// The value for this preset out of three, from the fastest to the most accurate.
    pub fn of<T>(self, [fast, balanced, accurate]: [T; 3]) -> T {
        match self {
            Self::Fast => fast,
            Self::Balanced => balanced,
            Self::Accurate => accurate,
        }
    }

    /// Help of this preset in a tool: the options that it sets, and its measured time and error.
    pub fn help(self, sets: &[String]) -> String {
        format!("{}; {}", sets.join(" "), self.measured())
    }

    /// Time and error with this preset in all tools, relative to balanced: geometric means over nine cameras, measured
    /// by `scripts/studies/presets choose`.
    fn measured(self) -> &'static str {
        self.of([
            "the chain takes 0.8 of balanced's time; errors are the same on average, at most 1.3 times as large in w",
            "between the two",
            "2.1 times balanced's time; 0.8 of its error in u, 0.7 in w",
        ])
    }

    /// Value parser of a tool's `--preset`; `help` gives the help of each preset.
    pub fn parser(help: fn(Self) -> String) -> impl TypedValueParser<Value = Self> {
        let value = |preset: &Self| Some(preset.to_possible_value()?.help(help(*preset)));
        PossibleValuesParser::new(Self::value_variants().iter().filter_map(value))
            .try_map(|name| Self::from_str(&name, false))
    }
}

impl Session {
    /// Prints with `--verbose` what a preset sets: options as on the command line, each with whether it takes effect.
    /// An option that is also typed does not.
    pub fn explain_preset(&self, preset: Preset, sets: impl IntoIterator<Item = (String, bool)>) {
        let (used, typed): (Vec<_>, Vec<_>) = sets.into_iter().partition(|(_, is_used)| *is_used);
        let words = |sets: Vec<(String, bool)>| sets.into_iter().map(|(set, _)| set).collect::<Vec<_>>().join(" ");
        let [used, typed] = [used, typed].map(words);
        let used = if used.is_empty() { "nothing" } else { &used };
        let typed = if typed.is_empty() { typed } else { format!("; the command line replaces its {typed}") };
        self.explain(format!("preset {} sets {used}{typed}", word(&preset)));
    }
}

#[cfg(test)]
mod tests {
    use super::numbers;

    #[test]
    fn lists_have_the_wanted_length() {
        assert_eq!(numbers::<3>("1, 2,-1.5e1"), Ok([1.0, 2.0, -15.0]));
        for wrong in ["1,2", "1,2,3,4", "1,2,x", "1,2,inf", "1,2,NaN", "", "1,2,"] {
            assert!(numbers::<3>(wrong).is_err(), "{wrong}");
        }
    }
}
