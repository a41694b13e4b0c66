//! In: the command line of `lf-calib`. Out: files, messages and an exit code.
//! `arguments.rs` describes the options; each task reads its files, calls the library once and writes its results.
//! Open `run.rs` first.

mod arguments;
mod background;
mod blur;
mod files;
mod fill;
mod frame;
mod lattice;
mod main_lens;
mod noise;
mod nominal;
mod parse;
mod refine;
mod run;
mod target_images;

pub use run::run;
