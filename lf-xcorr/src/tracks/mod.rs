//! Vectors from particles that are matched between the two frames.
//!
//! In: a field that predicts, and the particles of both frames with their covariances.
//! Out: the pairs, and the field that they decide.
//! Open `decide.rs` first.

mod assemble;
mod buckets;
mod decide;
mod evidence;
mod fitter;
mod guess;
mod log_field;
mod matching;
mod near;
mod points;
mod priors;
mod process;
mod scales;
mod window_fit;

pub use decide::{Tracks, TracksReport, decide};
pub use matching::Pair;
