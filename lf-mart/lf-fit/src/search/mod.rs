//! In: the particles of a frame. Out: the particles after a fit of each tile, or after drops, splits and additions.
//! First file to open: `particles.rs`.

pub mod changes;
pub mod ends;
pub mod particles;
pub mod sizes;
pub(crate) mod summed;
pub mod tile_fit;
pub mod tiles;
