//! The correlation of one pass.
//!
//! In: rows of lit voxels, a grid of interrogation windows and a box of trial shifts for each of them.
//! Out: the correlation peak of every window, to a fraction of a voxel.
//! Open `measure.rs` first.

mod cost;
mod energy;
mod fit;
mod kernel;
mod light;
mod measure;
#[cfg(test)]
mod oracle;
mod peak;
mod score;
pub(crate) mod shared_sums;
mod shifts;
mod sums;
mod table;
mod transform;
mod window_grid;

pub(crate) use cost::Estimate;
pub(crate) use measure::{Summation, Watch, measure};
pub(crate) use peak::{Peak, PeakFit};
pub(crate) use shifts::Shifts;
pub(crate) use transform::Transforms;
pub(crate) use window_grid::{WindowAxis, WindowGrid};
