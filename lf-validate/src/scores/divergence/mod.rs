//! In: a measured vector field, without its truth.
//! Out: the divergence of the field and the noise of its components.
//! Open first: `gradients.rs`.

mod gradients;
mod noise;

pub use gradients::{BINS_PER_SIGMA, Divergence, DivergencePdf, REACH, divergence, stride};
pub use noise::{FieldNoise, LEAST_DIFFERENCES, NoiseEstimate, noise};
