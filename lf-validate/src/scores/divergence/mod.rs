//! In: a measured vector field, without its truth.
//! Out: the divergence of the field and the noise of its components.
//! Open first: `gradients.rs`.

mod gradients;
pub mod noise;

pub use gradients::{BINS_PER_SIGMA, Density, Divergence, REACH, divergence, stride};
