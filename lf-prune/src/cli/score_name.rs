//! The words that `--score` takes.

use clap::ValueEnum;

#[derive(Clone, Copy, ValueEnum)]
pub enum ScoreName {
    /// Geometric mean of the pixels
    Geometric,
    /// The darkest pixel
    Minimum,
    /// A low quantile of the pixels, which a few dead or noisy ones cannot change
    Quantile,
}
