//! In: a measured vector field, and the true displacement: a field, a flow or particles.
//! Out: bias, RMS, spread, outliers and density of the errors, and how well the stated uncertainty covers them.
//! Open first: `compare.rs`.

mod compare;
pub mod coverage;
pub mod tracks;
pub mod trilinear;
pub mod truth;

pub use compare::{Displacement, Errors, OUTLIER_FLOOR_VOX, OUTLIER_SIGMAS, Particles, displacement};
pub use tracks::{Tracks, tracks};
pub use truth::{Sample, Truth, samples};
