//! In: a result, and the truth where a score needs it: volumes, vector fields, particles.
//! Out: one struct for each score, which serialises to the JSON that `lf-validate` prints.
//! Open first: `quality/compare.rs`, the score of a volume, and `displacement/compare.rs`, the score of a field.

pub mod benchmark;
pub mod depth;
pub mod displacement;
mod distribution;
pub mod divergence;
pub mod elongation;
pub mod ensemble;
#[cfg(test)]
pub(crate) mod fixtures;
pub mod light;
pub mod particles;
pub mod precision;
pub mod quality;
pub mod self_check;
pub mod slabs;
pub(crate) mod units;
