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
pub use pdf::{BINS_PER_PX, BINS_PER_VOX, ErrorPdf, REACH};
pub use summary::{ErrorSummary, OUTLIER_FLOOR_VOX, OUTLIER_SIGMAS};
pub use tracks::{Tracks, tracks};
pub use trilinear::{Interpolated, interpolate};
pub use truth::{TrueDisplacement, VectorError, errors};
