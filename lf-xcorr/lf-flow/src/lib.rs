//! Measured fields to flows: what is done with a field before it is averaged or shown.
//!
//! In: a [`lf_core::Field`] with stated uncertainties. Out: a field that is smooth or free of divergence, gradients,
//! pressure, values along a line and through a plane, each with its uncertainty.
//! Open first: `measured.rs`, the vectors and their uncertainties; then `solenoidal.rs`.
//!
//! One discrete derivative serves all tasks (`slopes.rs`): central differences, one-sided at the ends of an axis. A
//! field that `solenoidal` has made is free of the divergence that `derive` prints.

mod bands;
mod bend;
mod conjugate;
mod derive;
mod errors;
mod fill;
mod forces;
mod lines;
mod measured;
mod memory;
mod planes;
mod pressure;
mod profile;
mod roughness;
mod scalars;
mod slopes;
mod smooth;
mod solenoidal;
mod spread;
mod strength;
mod ties;

pub use derive::{Derived, derive};
pub use forces::PressureOptions;
pub use measured::{Measured, TypedSigma};
pub use memory::Task;
pub use pressure::{Pressure, pressure};
pub use profile::{Flux, Profile, flux, profile};
pub use smooth::{Smoothed, smooth};
pub use solenoidal::{SMOOTHED, Solenoidal, solenoidal};

#[cfg(test)]
mod tests;
