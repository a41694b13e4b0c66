//! In: the white image, the lattice found in it and the calibrated camera. Out: an SVG with pieces of the image and the
//! lenslets' centres over them, and over the whole frame, as arrows, the departure of the lenslets from a perfect
//! lattice and the residual that the camera does not explain. Open `picture.rs` first.

mod crops;
mod fields;
mod picture;

pub use picture::lattice;
