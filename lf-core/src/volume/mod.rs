//! Sparse volumes: a grid, the indices of some of its voxels, and named columns of values.
//!
//! In: `.lfv` files. Out: views of their columns, and new files.
//! Open first: [`format`], the specification of `.lfv`. [`tile`] cuts a volume in parts, [`joined`] puts them together.

pub mod format;
pub mod joined;
pub mod tile;

pub use format::{SIGNATURE, Volume, write, write_with};
pub use joined::{JoinedVolume, together};
pub use tile::Tile;
