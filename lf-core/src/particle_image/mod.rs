//! In: a camera and a particle's place and size. Out: the share of its light on each pixel, and how this share changes
//! with the place, the size and the place of the lattice. All derivatives are exact.
//! First file to open: `model.rs`; `lenslet_image.rs` holds the integral.
//!
//! A particle is a Gaussian spot of standard deviation s at one depth. A ray of it through the place U of the stop
//! meets the array at `m + alpha U + xi`, where m is the hit of the chief ray and xi the ray's place in the spot as the
//! array sees it, of standard deviation `beta s`. The sensor stands near the focus of the lenslets, so a pixel under a
//! lenslet is a small rectangle of the stop, wherever the particle is. The light on the pixel is the integral over this
//! rectangle of H, the lenslet's cell blurred by the spot:
//!
//! ```text
//! light = 1/A int_pixel H(m + alpha U - c) dU,   H = cell * Gaussian,   A = area of the stop
//!       = (G(1, 1) - G(0, 1) - G(1, 0) + G(0, 0)) / (A alpha^2)
//! ```
//!
//! Here G is the double integral of H, taken at the corners of the pixel. A table holds G for any shape of cell, and
//! with it all derivatives. Near focus alpha tends to 0; there the mean of H over the pixel is taken at four points.
//! Both forms agree where one takes over from the other, so the light has no step.
//!
//! For a rectangular cell along the axes, H and G are products of a function of x and one of y, and so is the light of
//! a pixel (`rectangle.rs`).
//!
//! The rim of a round stop leaves a part of a pixel's rectangle: strips across the rim, each a rectangle again, in both
//! forms. Where a lenslet sees only a part of a pixel, pixels at the rim are cut into finer ones.
//!
//! A blurred sensor has an integral of its own (`fine.rs`), and where rays are straight a faster one (`even.rs`), which
//! is less exact where the stop cuts a lenslet's light. The light that diffraction sends far is not in a particle's
//! image: see [`crate::halo`].
//!
//! Where lenslets show Fresnel's pattern, the waves of the stop and of the cell are one. `coherent.rs` sums them, and
//! [`ParticleModel::visit_rest`] has what that adds to the light of the fast images.
//!
//! Simplifications: a spot's own width does not move the pixels' edges on the stop (it does by 0.001 px in focus, by
//! 0.02 px with a gap that is a fortieth too long), and distortion does not stretch the spot into an ellipse.

mod axis;
mod beam;
mod blurred_factors;
mod cell_nodes;
mod cell_surface;
mod coherent;
mod cross;
mod departure;
mod edge_sums;
mod even;
mod factor;
mod fine;
mod fine_light;
mod fine_sensor;
mod fresnel;
mod inside;
mod lenslet_image;
mod lenslet_lines;
mod model;
mod picture_means;
mod pictures;
mod place;
mod quantities;
mod rectangle;
mod rim;
mod sensor_blur;
mod share;
mod spline;
mod spot_points;
mod spots;
mod stop_wave;
mod table;
#[cfg(test)]
mod tests;
mod view;
mod wave_buffers;

pub use lenslet_image::{Patch, Scratch};
pub use model::ParticleModel;
pub use quantities::{PLACES, QUANTITIES};
