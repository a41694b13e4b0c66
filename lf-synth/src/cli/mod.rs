//! In: the words of a command line.
//! Out: files, messages and an exit code.
//! Open `arguments.rs` first.

mod arguments;
mod calibration;
mod frames;
mod images;
mod run;
mod setup;

pub use run::main;
