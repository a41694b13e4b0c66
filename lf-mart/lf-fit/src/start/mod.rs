//! In: an image, its camera, and a volume or a support. Out: the first particles.
//! First file to open: `first.rs`. `sweeps.rs` finds light on a support, `coarse.rs` holds its voxels, `maxima.rs`
//! takes the particles from it.

mod coarse;
pub(crate) mod first;
mod maxima;
mod sweeps;
