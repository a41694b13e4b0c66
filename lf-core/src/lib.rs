//! What a stage of the light-field chain is made of: files, camera, grid, rays, weights.
//!
//! A tool of your own links this crate and reads and writes the same files as the six tools do.
//! Lengths are millimetres, image places pixels; the frame and its signs are in [`optics`].

pub mod camera;
pub mod cli;
pub mod error;
pub mod field;
pub mod flow;
pub mod grid;
pub mod history;
pub mod image;
pub mod io;
pub mod lattice;
pub mod optics;
pub mod particles;
pub mod plot;
pub mod scene;
pub mod simd;
pub mod statistics;
pub mod volume;
pub mod weights;

pub use error::{Error, Refusal, Result};
