//! In: an image, its camera, and a volume. Out: particles with uncertainties, the size of particles, the camera's
//! drift. First file to open: `recipe.rs`; then `joint.rs`, the fit of a group, and `changes.rs`.
//!
//! The local maxima of the volume are the first particles. All are fitted together to the raw pixels by
//! Levenberg-Marquardt ([`lf_core::particle_image`] has the model), weighed by the noise. Then particles are dropped,
//! split and added where the likelihood asks for it.
//! Several cameras of one moment are fitted together: `together.rs`.
//!
//! Sources: iterative particle reconstruction (Wieneke 2013; Jahn, Schanz & Schroeder 2021) and two-pulse
//! Shake-the-Box (Novara et al. 2023) for the rounds of a fit.

mod align;
mod buffers;
mod candidates;
mod changes;
mod cloud;
mod covariance;
mod draw;
mod entries;
mod further;
mod image;
mod joint;
mod local;
mod memory;
mod merge;
mod noise;
mod normal;
mod recipe;
mod shape;
mod spot;
mod together;
mod view;
mod window;

pub use draw::draw;
pub use memory::{peak_bytes, together_bytes};
pub use noise::{Given, Noise};
pub use recipe::{Fit, FitOptions, Found, Progress, fit};
pub use shape::{Free, Shape};
pub use spot::Spot;
pub use together::{CameraFit, Sight, Together, fit_together};
