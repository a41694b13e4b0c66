//! Renders light-field frames of particles in a flow by ray tracing, and writes the exact answer beside them.
//!
//! ```text
//! scene.json -> scene: checked keys, or a target of dots
//!            -> particles: seeded, carried by the flow, lit by the sheet
//!            -> rays: through main lens and lenslets to counts on the sensor
//!            -> sensor: recorded counts, with noise
//! particles  -> truth: exact volumes and displacements
//! memory: bytes of all that, before it is made
//! ```
//!
//! This crate traces rays only. It may not use the weights of `lf-core`: the reconstruction would then be judged by its
//! own model.

mod key_checks;
pub mod memory;
pub mod particles;
mod random;
pub mod rays;
pub mod scene;
pub mod sensor;
pub mod truth;

pub use scene::Scene;
