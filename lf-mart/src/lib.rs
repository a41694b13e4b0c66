//! Image, camera and voxels to intensities, by multiplicative algebraic reconstruction.
//!
//! Data flow: a [`Plan`] takes camera, grid, voxels and [`Options`], chooses the weights ([`lf_core::weights`]) and
//! knows its memory. [`Plan::solve`] takes the image; a method (`method/`) repeats sweeps: project the strengths of the
//! voxels (`operator/`), compare with the image, project back, move the strengths. `blob.rs` turns strengths into the
//! [`Reconstruction`].
//!
//! # Methods
//!
//! - `mart` is the row action of Shi, Ding, New & Soria (2017), eq. 1: pixel after pixel, with stored weights.
//! - `smart` and `mlem` move all voxels by all pixels at once.
//! - `subsets`, the default, is `smart` over interleaved image rows, one subset of rows after another, with momentum.
//!
//! For a lattice that is aligned with the pixels, all methods except `mart` make weights from profiles where they use
//! them. For other cameras a matrix is kept if it fits.

mod blob;
mod method;
mod operator;
mod options;
mod plan;
mod reconstruction;

pub use options::{Method, Options, Until};
pub use plan::Plan;
pub use reconstruction::{Ended, Reconstruction, Start, Sweep};

#[cfg(test)]
mod tests;
