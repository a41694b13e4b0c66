//! In: a measured vector field, and the true displacement: a field, a flow or particles.
//! Out: bias, RMS, spread, outliers and density of the errors, and how well the stated uncertainty covers them.
//! Open first: `compare.rs`.

mod compare;
mod coverage;
mod pdf;
mod summary;
mod tracks;
mod trilinear;
mod truth;

pub use compare::{Displacement, ParticleCounts, displacement};
pub use coverage::Coverage;
pub use summary::ErrorSummary;
pub use tracks::{Tracks, tracks};
pub use truth::TrueDisplacement;
