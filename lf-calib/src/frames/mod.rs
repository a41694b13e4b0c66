//! Corrections of raw frames before the chain: sensitivity, hot pixels, uneven lasers.
//!
//! In: frames, one after another. Out: the same frames corrected, and what changed. Open first: `correction.rs`; it
//! applies what `hot.rs` and `lasers.rs` find.

mod correction;
mod hot;
mod lasers;

pub use correction::{Change, Correction, Sensitivity};
pub use hot::HotPixels;
pub use lasers::{Factor, Lasers};
