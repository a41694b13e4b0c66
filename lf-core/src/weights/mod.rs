//! In: a camera, a grid, a model and a basis. Out: for each voxel, the pixels that it lights and their weights.
//! Knows no files and casts no rays; first file to open: `choice.rs`, then the path of interest, then `axis.rs`.
//!
//! The weight w(voxel, pixel) is the share of the light that a voxel sends through the aperture and that lands on the
//! pixel. Weights are not negative. They sum to 1 over the pixels of a voxel whose light all reaches the sensor.
//!
//! A lenslet's cell is a stack of upright rectangles. In each rectangle a weight is the product of a column's share and
//! a row's share ([`Piece`]), times what a round stop leaves of it ([`Chords`]). If the cells are aligned with the
//! pixels, the column shares of a voxel serve all its rows: see [`Aligned`].
//!
//! Sources: the exact weights integrate the equations of [`crate::optics`]; the dense-ray-tracing weights are those of
//! Shi, Ding, New & Soria (2017); the sphere weights are those of Elsinga et al. (2006).

mod aligned;
mod axis;
mod bent;
mod blur;
mod cell;
mod choice;
mod chords;
mod geometry;
mod lenslets;
mod micro;
mod model;
mod pieces;
mod sphere;
#[cfg(test)]
mod tests;

pub use aligned::Aligned;
pub use axis::Piece;
pub use choice::{Path, Scratch, Weights};
pub use chords::Chords;
pub use lenslets::Lenslets;
pub use micro::{Lines, Micro, MicroImages};
pub use model::{Basis, Model, RowSet, SECTIONS, aperture_sections, check_depth, check_depth_mm, sections};
pub use pieces::Pieces;
pub use sphere::Sphere;
