//! In: levels, a camera whose rays are straight, and a slice. Out: the voxels kept, by sums along lines of voxels.
//! First file to open: `line_sums.rs`, then `crossings.rs`; `views.rs` is what each section sees through each lenslet.

mod cell;
mod crossings;
mod lattice_lines;
pub(super) mod line_sums;
pub(super) mod tiles;
mod traced;
mod views;

pub(super) use views::{Views, straightened};
