//! Particles and a flow to light-field images and the truth, by casting rays.
//!
//! Rays only: this crate may not use the weights of `lf-core`, or the reconstruction would be judged by its own model.

pub mod flow;
pub mod particles;
pub mod ready;
pub mod render;
pub mod scene;
pub mod truth;

pub use scene::Scene;
