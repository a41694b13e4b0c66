//! In: many measured vector fields of one flow, one after another. Out: their mean with its uncertainty, fluctuations,
//! and the vorticity of the mean; how these settle with the number of fields. Open first: `sums.rs`.

mod convergence;
mod statistics;
mod sums;

pub use convergence::{ConvergenceLog, ConvergenceStep, fields_for_1_percent};
pub use statistics::{Ensemble, EnsembleSummary};
pub use sums::EnsembleSums;
