//! In: the light of the true and of the reconstructed volume, on one grid.
//! Out: Q, ghosts and missed light, of the whole, of each slice across z and of each box.
//! Open first: `compare.rs`.

mod compare;
mod score;

pub use compare::{quality, quality_bytes};
pub use score::{Quality, VolumeScore};
