//! In: images, their cameras, and a volume of each. Out: particles with uncertainties, the size of particles, the drift
//! of each camera, and the poses of further ones.
//! First file to open: `stages.rs`.

mod cameras;
mod draw;
mod memory;
mod model;
mod particle;
mod search;
mod shared;
mod solve;
mod stages;

pub use cameras::input::CameraInput;
pub use cameras::noise::{KnownNoise, Noise};
pub use cameras::shape::{Free, Shape};
pub use cameras::view::CameraView;
pub use draw::draw;
pub use memory::estimated_bytes;
pub use particle::{FoundParticle, Particle};
pub use stages::{Changes, Fit, FitOptions, Progress, fit};
