//! Vectors: tested, filled, smoothed, and their uncertainties.
//!
//! In: the correlation peaks of a pass, on the grid of its windows.
//! Out: outliers found and replaced, a smooth field, a standard uncertainty for each vector.
//! Open `vector.rs` first.

mod bend;
mod evidence;
mod fill;
mod image_sums;
mod median_test;
mod nodes;
mod particle_images;
mod response;
mod smooth;
mod uncertainty;
mod vector;

pub(crate) use evidence::smoothed_by_evidence;
pub(crate) use fill::{fill, filled};
pub use median_test::MedianTest;
pub(crate) use nodes::Nodes;
pub(crate) use particle_images::ParticleImages;
pub(crate) use response::{Noise, noise_ratio, unresolved};
pub(crate) use uncertainty::{Measured, Uncertainty};
pub(crate) use vector::Vector;
