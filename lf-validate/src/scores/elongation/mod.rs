//! In: the light of reconstructed volumes, and the true places of their particles.
//! Out: diameters of the particles along x, y and z: percentiles, histogram, medians by depth.
//! Open first: `measure.rs`.

mod measure;
mod profile;
mod score;

pub use measure::elongation;
pub use score::{BIN_VOX, BINS, DiametersByDepth, Elongation, Histogram, IDEAL_VOX, Percentiles, SLABS, Widths};
