//! The lattice of the microlenses: which lenslet holds a point of the array, and where its centre is.
//!
//! In: the keys `microlenses` and `centres` of a camera. Out: a [`Lattice`], which maps points to lenslets and back.
//! Open first: `microlenses.rs`, the keys and the equation of a centre.

mod centres;
mod lenslets;
mod microlenses;

pub use centres::{Centres, MOST_DEGREE, terms};
pub use lenslets::Lattice;
pub use microlenses::{Layout, Microlenses};
