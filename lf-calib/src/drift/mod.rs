//! In: frames of particles and a camera. Out: the camera corrected for a drift of its lattice and for small sensor
//! tilts. The light of an isolated particle fills the stop. Its middle shows where the lattice is, its size shows tilt.
//! Open `refine.rs` first.

mod disparity;
mod isolated;
mod refine;
mod report;
mod stop_fill;

pub use refine::{refine, refine_steps};
pub use report::Refined;
