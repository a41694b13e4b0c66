//! In: many measured vector fields of one flow, one after another.
//! Out: their mean with its uncertainty, fluctuations, and the vorticity of the mean.
//! Open first: `sums.rs`.

mod sums;

pub use sums::{Ensemble, Summary, Sums};
