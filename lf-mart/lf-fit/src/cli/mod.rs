//! In: the command line. Out: files, messages and the exit code.
//! First file to open: `run.rs`; `arguments.rs` holds the options, `inputs.rs` the files of each camera.

mod arguments;
mod inputs;
mod run;

pub use run::main;
