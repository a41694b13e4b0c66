//! The command line of lf-xcorr.
//!
//! In: typed words and files.
//! Out: a field file, a picture, lines on standard error.
//! Open `run.rs` first.

mod arguments;
mod drawn;
mod parse;
mod particles;
mod report;
mod run;
mod warnings;
mod windows;

pub use arguments::Arguments;
pub use run::run;
