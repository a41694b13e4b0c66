//! In: one frame and its camera. Out: two frames of independent noise, or two flat fields that blind a part of the
//! pixels each.
//! Open first: `counts.rs`, then `blind.rs`.

mod blind;
mod counts;

pub use blind::{held_out, pupil_halves};
pub use counts::thinned;
