//! Image and camera to the voxels that may hold light: dense ray tracing with a multiplicative line of sight.
//!
//! Data flow: a [`PrunePlan`] takes camera, grid and [`PruneOptions`] and knows its memory. [`PrunePlan::prune`] turns
//! the image into whole-number shades (`score/shades.rs`), adds the shades of each voxel's rays (`score/`), and keeps
//! the voxels that are bright enough as the [`Support`]. [`Automatic`] finds a threshold from the image.
//!
//! A ray through the centre of every section of the aperture is traced from every voxel to a pixel. A particle in the
//! voxel would light all of these pixels. So a voxel is kept if their product (a mean of logarithms, or the smallest of
//! them) is high enough. Source: Shi, Ding, New & Soria (2017), section 2, after Atkinson & Soria (2009).

mod explained;
mod options;
mod plan;
mod score;
mod threshold;

pub use lf_core::views::Region;
pub use options::{BRIGHT_THRESHOLDS, DARK_THRESHOLDS, FORGIVING, PruneOptions, Score};
pub use plan::{PrunePlan, Support};
pub use threshold::Automatic;

#[cfg(test)]
mod tests;
