//! Particles that were found, against the true ones.
//!
//! In: two lists of particles of one frame. Out: how many were found and how many are ghosts, errors and stated
//! uncertainties, whole and by depth.
//! Open first: `score.rs`; `matches.rs` says which particle is which.

mod matches;
mod score;

pub(crate) use matches::matches;
pub use score::{Accuracy, ParticleScore, particles};
