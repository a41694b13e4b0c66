//! The correlation of one pass.
//!
//! In: rows of lit voxels, a grid of interrogation windows and a box of trial shifts for each of them.
//! Out: the correlation peak of every window, to a fraction of a voxel.
//! Open `measure.rs` first.

mod energy;
mod fit;
mod kernel;
mod measure;
#[cfg(test)]
mod oracle;
mod peak;
mod score;
pub(crate) mod shared_sums;
mod shifts;
mod sums;
mod table;
mod window_grid;

pub(crate) use measure::{Watch, measure};
pub(crate) use peak::{Peak, PeakFit};
pub(crate) use shifts::Shifts;
pub(crate) use window_grid::{WindowAxis, WindowGrid};
