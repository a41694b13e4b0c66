//! The background: what stays in every frame, or in the frames about each.
//!
//! In: frames, one after another. Out: an image, or one for each frame. Open `quantile.rs` first.

mod cells;
mod haze;
mod quantile;
mod sliding;

pub use haze::{Haze, haze};
pub use quantile::Background;
pub use sliding::SlidingMinimum;
