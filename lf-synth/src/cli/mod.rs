//! In: the words of a command line.
//! Out: files, messages and an exit code.
//! Open `arguments.rs` first.

mod arguments;
mod dots;
mod frames;
mod images;
mod run;
mod scene;
mod setup;
mod white;

pub use run::main;
