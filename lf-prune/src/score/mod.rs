//! In: the image, a camera, and the voxels of a slice. Out: the voxels kept, each with its score.
//!
//! A voxel's score is a sum over its rays: [`lf_core::views`] has the method.
//!
//! First file to open: `scorer.rs`. `oracle.rs` checks it, ray by ray.

#[cfg(test)]
mod oracle;
mod scorer;
mod shades;
mod views;

#[cfg(test)]
pub(crate) use oracle::{Oracle, Tolerance};
pub(crate) use scorer::{Scorer, thread_bytes, views_bytes};
pub(crate) use shades::Shades;
