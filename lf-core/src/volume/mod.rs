//! Sparse volumes: a grid, the indices of some of its voxels, and named columns of values.
//!
//! In: `.lfv` files. Out: views of their columns, and new files.
//! Open first: [`mod@format`], the specification. [`tile`] cuts a volume into tiles, [`joined`] puts them together.

pub mod format;
mod header;
pub mod joined;
mod reach;
mod reader;
pub mod tile;
mod writer;

pub use format::SIGNATURE;
pub use joined::{JoinedVolume, together};
pub use reader::Volume;
pub use tile::Tile;
pub use writer::{write, write_with};
