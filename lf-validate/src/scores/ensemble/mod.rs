//! In: many measured vector fields of one flow, one after another.
//! Out: their mean with its uncertainty, fluctuations, and the vorticity of the mean.
//! Open first: `sums.rs`.

mod statistics;
mod sums;

pub use statistics::Ensemble;
pub use sums::EnsembleSums;
