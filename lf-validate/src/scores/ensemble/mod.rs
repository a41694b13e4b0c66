//! In: many measured vector fields of one flow, one after another. Out: their mean with its uncertainty, fluctuations,
//! and the vorticity of the mean; how these settle with the number of fields, averages by phase, spectra and
//! correlations along an axis, proper orthogonal modes. Open first: `sums.rs`.

mod convergence;
mod lines;
mod modes;
mod phases;
mod statistics;
mod sums;

pub use convergence::{ConvergenceLog, ConvergenceStep, enough};
pub use lines::{LineStatistics, LineSums};
pub use modes::{ModeStatistics, ModeSums};
pub use phases::{PhaseSummary, PhaseSums};
pub use statistics::{Ensemble, EnsembleSummary};
pub use sums::EnsembleSums;
pub(crate) use sums::check_layout;
