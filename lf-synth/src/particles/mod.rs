//! In: a flow, a volume, times and a light sheet, or a `particles.csv`.
//! Out: the lit particles of each frame.
//! Open `tracers.rs` first.

mod seed;
mod sheet;
pub mod table;
mod tracers;

pub use seed::{Appearance, seed_evenly};
pub use sheet::Sheet;
pub use tracers::{Particle, Tracers, inside};
