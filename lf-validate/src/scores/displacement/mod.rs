//! In: a measured vector field, and the true displacement: a field, a flow or particles.
//! Out: bias, RMS, spread, outliers and density of the errors, and how well the stated uncertainty covers them.
//! Open first: `compare.rs`.

mod coarse;
mod compare;
mod statistics;
mod truth;

pub use compare::{Displacement, ParticleCounts, displacement};
pub use statistics::{Coverage, ErrorSummary};
pub use truth::{Tracks, TrueDisplacement, tracks};
