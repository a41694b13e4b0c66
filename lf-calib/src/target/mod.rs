//! In: images of a dot target at known depths and a nominal camera. Out: a camera with its main lens, distortion and
//! misalignment, each with its uncertainty.
//! Open `main_lens.rs` first.

mod blunder;
mod bundle;
mod depths;
mod doubts;
mod exposure;
mod look;
mod main_lens;
mod recognise;
mod report;
mod selection;

pub use blunder::blunder;
pub use depths::{depths_of_names, depths_of_table};
pub use doubts::{closer_dots_mm, fit_doubts};
pub use exposure::{Dot, Exposure, grid};
pub use main_lens::{main_lens, main_lens_steps};
pub use report::MainLensFit;
