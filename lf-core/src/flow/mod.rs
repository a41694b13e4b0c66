//! Flows: the key `flow` of a `scene.json`, and the velocity fields that follow from it.
//!
//! In: the JSON of a flow, the bounds of the volume, and the files of sampled fields. Out: a [`Velocity`], which moves
//! particles and gives displacements.
//! Open first: `kinds.rs`, the flows and their keys; `velocity.rs` carries particles.
//!
//! A flow is one object of [`Flow`], or a list of them whose velocities add up ([`Flows`]). The flow is steady.
//! Displacements are those of a unit of time, the interval between two frames.

mod flows;
mod kinds;
mod terms;
mod velocity;

pub use flows::{Flows, MOST_STEPS};
pub use kinds::{Axis, Case, Flow};
pub use terms::Sampled;
pub use velocity::{Velocity, places};

#[cfg(test)]
mod tests;
