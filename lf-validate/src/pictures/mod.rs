//! The charts behind `--plot`: each score beside a reference to compare it with.
//!
//! In: a score, as `scores` computes it. Out: a [`lf_core::plot::Chart`]. Each file draws one score; open `quality.rs` first.

mod depth;
mod displacement;
mod divergence;
mod elongation;
mod ensemble;
mod quality;
mod series;

pub use depth::depth;
pub use displacement::displacement;
pub use divergence::divergence;
pub use elongation::elongation;
pub use ensemble::ensemble;
pub use quality::quality;
