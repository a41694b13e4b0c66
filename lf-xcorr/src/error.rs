//! Why two volumes cannot be correlated.

/// Which of the inputs a refusal is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The first volume of a pair, counted from 0.
    First(usize),
    /// The second volume of a pair.
    Second(usize),
    /// The volumes together.
    Both,
    /// The mask.
    Mask,
    /// The options, whatever the volumes hold.
    Options,
}

/// A refusal: what was found, and what was wanted instead.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{found}; {wanted}")]
pub struct Error {
    /// The input it is about.
    pub side: Side,
    /// What was found there.
    pub found: String,
    /// What was wanted.
    pub wanted: String,
}

impl Error {
    pub(crate) fn new(side: Side, found: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { side, found: found.into(), wanted: wanted.into() }
    }
}
