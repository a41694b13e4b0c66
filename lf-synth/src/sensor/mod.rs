//! In: expected counts of an image, the sensor's keys, a seed.
//! Out: recorded counts.
//! Open `noise.rs` first, then `chain.rs` for the model.

mod chain;
mod noise;
#[cfg(test)]
mod tests;

pub use chain::Recorded;
pub use noise::SensorNoise;
