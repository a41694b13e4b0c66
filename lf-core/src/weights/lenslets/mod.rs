//! In: a voxel and the image rows asked for. Out: runs of pixels with their weights, each lenslet's image of the voxel
//! looked up in a table by its place among the pixels.
//! First file to open: `lookup.rs`; `patch.rs` is the table, `cut.rs` cuts an image by the stop.

mod cut;
mod lookup;
mod patch;
mod slice;

pub use lookup::Lenslets;
pub(super) use lookup::LookupBuffers;
