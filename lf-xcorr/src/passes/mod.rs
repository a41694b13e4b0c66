//! The passes of a run, coarse to fine; the last one is repeated on deformed volumes until its vectors stop changing.
//!
//! In: pairs of volumes, a mask, options, all of them checked.
//! Out: the field, and a report of every pass.
//! Open `multigrid.rs` first.

mod deform;
pub(crate) mod memory;
pub(crate) mod multigrid;
mod options;
mod outcome;
mod pass;
mod predictor;
mod prepared;
mod repeats;
mod search;

pub use options::{Deform, Options};
pub use outcome::{Counts, Outcome, PassReport, Repeat};
pub use pass::{Pass, triple};
