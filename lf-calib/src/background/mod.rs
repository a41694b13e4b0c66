//! The background: what stays in every frame, or in the frames about each.
//!
//! In: frames, one after another. Out: an image, or one for each frame. Open `quantile.rs` first.

mod quantile;
mod sliding;

pub use quantile::Background;
pub use sliding::SlidingMinimum;
