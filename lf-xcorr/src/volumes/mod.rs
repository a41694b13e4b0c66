//! The volumes of a pair, as a correlation reads them.
//!
//! In: lit voxels of a grid, and a mask.
//! Out: rows of lit voxels along x, dark where they are masked.
//! Open `sparse.rs` first.

mod mask;
mod rows;
mod sparse;

pub use mask::Mask;
pub(crate) use rows::{Rows, lit};
pub use sparse::Sparse;
