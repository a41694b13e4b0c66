//! In: the command line. Out: files, messages and the exit code.
//! First file to open: `run.rs`; `arguments.rs` holds the options, `preset.rs` the presets' values.

mod arguments;
mod misfit;
mod preset;
mod run;

pub use run::main;
