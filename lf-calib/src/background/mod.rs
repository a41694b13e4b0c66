//! The background: what stays in every frame, or in the frames about each.
//!
//! In: frames, one after another. Out: an image, or one for each frame. Open `quantile.rs` first.

mod mean;
mod quantile;
mod sliding;

pub use mean::MeanBackground;
pub use quantile::Background;
pub use sliding::SlidingMinimum;
