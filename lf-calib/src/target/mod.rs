//! In: images of a dot target at known depths and a nominal camera. Out: a camera with its main lens, distortion and
//! misalignment, each with its uncertainty.
//! Open `main_lens.rs` first.

mod bundle;
mod depths;
mod exposure;
mod first_detection;
mod main_lens;
mod recognise;
mod report;
mod selection;
mod setup_mistakes;
mod warnings;

pub use depths::{depths_of_names, depths_of_table};
pub use exposure::{Dot, Exposure, grid};
pub use main_lens::{main_lens, main_lens_steps};
pub use report::MainLensFit;
pub use setup_mistakes::setup_mistake;
pub use warnings::{closer_dots_mm, fit_warnings};
