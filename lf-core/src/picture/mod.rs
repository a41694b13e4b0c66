//! A picture as SVG, PNG or PDF.
//!
//! In: the SVG of [`crate::plot::draw`]. Out: a file in the format of its name. Open `shapes.rs` first, which reads the few
//! elements that such an SVG has; text becomes the outlines of a font of our own, so that it looks alike everywhere.

mod font;
mod outline;
mod pdf;
mod pixels;
mod save;
mod shapes;

pub use save::save;
