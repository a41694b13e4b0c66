//! In: the command line. Out: files, messages and the exit code.
//! First file to open: `run.rs`; `arguments.rs` holds the options, `preset.rs` the presets' values.

mod again;
mod arguments;
mod preset;
mod pvr;
mod run;
mod threshold;
mod warnings;

pub use run::main;
