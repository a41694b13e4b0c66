//! Why two volumes cannot be correlated.

use lf_core::Refusal;

/// The input that a refusal is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The first volume of a pair; pairs are counted from 0.
    First(usize),
    /// The second volume of a pair.
    Second(usize),
    /// All volumes together.
    Both,
    /// The mask.
    Mask,
    /// The options; no volume would fit them.
    Options,
}

/// A refusal, and the input it is about; the caller knows the input's name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{refusal}")]
pub struct Refused {
    /// The input.
    pub side: Side,
    /// The value or state found, and the one wanted.
    pub refusal: Refusal,
}

impl Refused {
    pub(crate) fn new(side: Side, found: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { side, refusal: Refusal::new(found, wanted) }
    }
}
