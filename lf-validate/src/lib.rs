//! Results and truths to scores.
//!
//! - [`scores`]: volumes, fields and the truth in, one struct a score out.
//! - [`pictures`]: a score in, its chart out.
//! - [`export`]: a volume or particles in, a file for other programs out.
//! - [`report`]: the folder of a run in, a page that shows it out.
//! - [`split`]: a frame and its camera in, two of its parts out.
//! - [`info`]: the content of a file in, a description of one screen out.
//!
//! The structs serialise to the JSON that `lf-validate` prints. Sums are taken in `f64` in the order of the data, so
//! that a score depends on its inputs only, and not on the number of threads.

pub mod export;
pub mod info;
pub mod pictures;
pub mod report;
pub mod scores;
pub mod split;
