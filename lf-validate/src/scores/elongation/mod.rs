//! In: the light of reconstructed volumes, and the true places of their particles.
//! Out: diameters of the particles along x, y and z: percentiles, histogram, medians by depth.
//! Open first: `measure.rs`.

mod measure;
mod profile;
mod score;

pub use measure::elongation;
pub(crate) use score::{BIN_VOX, BINS, IDEAL_VOX};
pub use score::{Elongation, SizeCounts};
