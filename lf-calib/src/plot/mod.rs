//! A picture of a calibrated lattice.
//!
//! In: the white image, the lattice found in it and the calibrated camera. Out: an SVG with pieces of the white image
//! and the lenslets' centres over them, and with two fields of arrows over the whole frame: the departure of the
//! lenslets from a perfect lattice, and the residual that the camera does not explain. Open `picture.rs` first.

mod crops;
mod fields;
mod picture;

pub use picture::lattice;
