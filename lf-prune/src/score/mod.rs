//! In: the image as levels, a camera, and the voxels of a slice. Out: the voxels kept, each with its score.
//! First file to open: `scorer.rs`, the choice; then `rays.rs`, the slow and obvious way, which proves the others.

mod aligned;
mod levels;
mod lines;
mod rays;
mod scorer;
mod slice;

pub(crate) use levels::Levels;
pub(crate) use scorer::{Scorer, Scoring};
pub(crate) use slice::Sections;
