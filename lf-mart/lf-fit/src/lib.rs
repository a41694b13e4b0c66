//! In: images, their cameras, and a support or a volume of each. Out: particles with uncertainties, the size of
//! particles, the drift of each camera, and the poses of further ones.
//! First file to open: `stages.rs`.
//!
//! The local maxima of the volume, or of the light that sweeps find on the support, are the first particles. All are
//! fitted together to the raw pixels by Levenberg-Marquardt, weighted by the noise ([`lf_core::particle_image`] has the
//! model). Then particles are dropped, split and added where the likelihood asks for it. Cameras are a list. A camera
//! alone is a list of one, whose pose is the identity.
//!
//! The way of an image through the fit, file by file. The way returns to `stages.rs` where a line begins with a stage:
//!
//! 1. `stages.rs`: `fit` runs the stages for each camera alone, then for all together.
//! 2. Start: `cameras/view.rs` holds the image beside the expected counts, `start/` finds the particles.
//! 3. Fit: `search/particles.rs` takes it tile by tile,
//! 4. `search/tiles.rs` plans the windows of each tile on all sensors,
//! 5. `model/window.rs` cuts them out of the images,
//! 6. `model/particle_image.rs` renders the particles there,
//! 7. `solve/joint.rs` compares, and steps by the equations of `normal.rs`.
//! 8. Size and drift: `shared/shape_fit.rs` fits them in a part of the image.
//! 9. Rounds: `search/changes.rs` tries drops, splits and additions in the windows.
//! 10. Several cameras: `cameras/matching.rs` merges their particles, `shared/align.rs` fits their light and poses.
//!
//! Sources: iterative particle reconstruction (Wieneke 2013; Jahn, Schanz & Schroeder 2021) and two-pulse
//! Shake-the-Box (Novara et al. 2023) for the rounds of a fit.

mod cameras;
mod memory;
mod model;
mod particle;
mod search;
mod shared;
mod solve;
mod stages;
mod start;

pub use cameras::defects::Defects;
pub use cameras::input::CameraInput;
pub use cameras::noise::{KnownNoise, Noise};
pub use cameras::residual::{RANDOM, Residual};
pub use cameras::shape::{Free, Shape};
pub use cameras::view::CameraView;
pub use memory::estimated_bytes;
pub use particle::{FoundParticle, Particle};
pub use search::ends::PiledUp;
pub use stages::{Changes, Doubts, Fit, FitOptions, Progress, fit};
