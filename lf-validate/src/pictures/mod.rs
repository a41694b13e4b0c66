//! The charts behind `--plot`: each score beside a reference to compare it with.
//!
//! In: a score, as `scores` computes it. Out: a [`lf_plot::Chart`]. Open `volumes.rs` first.

mod fields;
mod series;
mod volumes;

pub use fields::{displacement, divergence, ensemble};
pub use volumes::{depth, elongation, quality};
