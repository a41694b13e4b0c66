//! In: a measured vector field, without its truth.
//! Out: the divergence of the field and the noise of its components.
//! Open first: `gradients.rs`.

mod gradients;
mod noise;

pub use gradients::{Divergence, divergence};
pub use noise::FieldNoise;
