//! Particles and a flow to light-field images and the truth, by casting rays.
//!
//! Rays only: this crate may not use the weights of `lf-core`, or the reconstruction would be judged by its own model.

pub mod cast;
pub mod diffraction;
pub mod dots;
pub mod light;
pub mod noise;
pub mod particles;
pub mod patch;
pub mod ready;
pub mod render;
pub mod samples;
pub mod scene;
pub mod sensor;
pub mod truth;

pub use scene::Scene;
