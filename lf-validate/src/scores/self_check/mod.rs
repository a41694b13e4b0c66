//! Checks of one real frame and its camera, without a truth.
//!
//! In: particles of two fits to parts of the frame, and the image that a fit expects where pixels were held out. Out:
//! whether the parts agree within the stated uncertainties, chi2 of the held-out pixels, and a verdict.
//! Open first: `agreement.rs`; `verdict.rs` has the limits.

mod agreement;
mod held_out;
mod verdict;

pub use agreement::{Agreement, Slab, agreement};
pub use held_out::{HeldOut, held_out};
pub use verdict::{SelfCheck, self_check};
