//! In: the command line. Out: files, messages and the exit code.
//! First file to open: `run.rs`; `arguments.rs` holds the tasks and their options.

mod arguments;
mod files;
mod profile;
mod run;
mod treat;

pub use arguments::Arguments;
pub use run::run;
