//! In: an image, its camera, and a volume. Out: particles with uncertainties, the size of particles, the camera's
//! drift. First file to open: `recipe.rs`; then `joint.rs`, the fit of a group, and `changes.rs`.
//!
//! The local maxima of the volume are the first particles. All are fitted together to the raw pixels by
//! Levenberg-Marquardt ([`lf_core::particle_image`] has the model), weighed by the noise. Then particles are dropped,
//! split and added where the likelihood asks for it.
//!
//! Sources: iterative particle reconstruction (Wieneke 2013; Jahn, Schanz & Schroeder 2021) and two-pulse
//! Shake-the-Box (Novara et al. 2023) for the rounds of a fit.

mod buffers;
mod candidates;
mod changes;
mod cloud;
mod covariance;
mod draw;
mod entries;
mod image;
mod joint;
mod local;
mod memory;
mod noise;
mod normal;
mod recipe;
mod shape;
mod spot;
mod window;

pub use draw::draw;
pub use memory::peak_bytes;
pub use noise::{Given, Noise};
pub use recipe::{Fit, FitOptions, Found, Progress, fit};
pub use shape::{Free, Shape};
pub use spot::Spot;
