//! Shared by the command lines of the tools: exit codes, errors, progress, `--stats`, `--threads`, `--preset`,
//! `--max-memory`.
//!
//! In: a tool's `clap` arguments and its body. Out: an exit code, and one line on standard error for every failure.
//! Open first: `run.rs`, a tool's `main`; then `session.rs`, the handle that the tool's body gets.
//!
//! Exit codes: 0 done; 1 judged, and the answer is no; 2 the work could not be done. Every failure ends in one line on
//! standard error that starts with the tool's name.

mod complaint;
mod frame_warnings;
mod generate;
mod help_all;
mod kernel_tables;
mod lengths;
mod memory;
mod progress;
mod run;
mod session;
mod values;

pub use lengths::length_mm;
pub use memory::{MemoryLimit, check_memory};
pub use progress::Progress;
pub use run::{Verdict, run};
pub use session::{Common, Session};
pub use values::{ImageOptions, Preset, numbers, word};
