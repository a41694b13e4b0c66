//! The lattice of the microlenses: which lenslet holds a point of the array, and where its centre is.
//!
//! In: the keys `microlenses` and `centres` of a camera. Out: a [`Lattice`], which maps points to lenslets and back.
//! Open first: `keys.rs`, the keys and the equation of a centre.

mod keys;
mod lenslets;

pub use keys::{Centres, Layout, MOST_DEGREE, Microlenses, terms};
pub use lenslets::Lattice;
pub(crate) use lenslets::chord;
