//! The particles in volumes before they are correlated, and the windows that suit them.
//!
//! In: pairs of volumes and a mask.
//! Out: number, places and lengths of the particle images; passes whose windows hold about ten of them.
//! Open `particles.rs` first.

mod particles;
mod windows;

pub use particles::Seeding;
pub use windows::{WANTED_PARTICLES, near_cube, sides_mm};
