//! In: an image, weights, voxels and options. Out: a strength for each voxel still held to have light, and the sweeps.
//! First file to open: `problem.rs`, then `simultaneous.rs` (`row_action.rs` is the paper's method).

mod dim_voxels;
mod momentum;
mod problem;
pub(crate) mod row_action;
pub(crate) mod simultaneous;
pub(crate) mod subsets;

#[cfg(test)]
pub(crate) use problem::DARK;
pub(crate) use problem::Problem;
