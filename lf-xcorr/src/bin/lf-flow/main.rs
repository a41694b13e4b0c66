//! lf-flow: measured fields to flows and what follows from them.

mod arguments;
mod files;
mod profile;
mod run;
mod treat;

use std::process::ExitCode;

fn main() -> ExitCode {
    lf_core::cli::run("lf-flow", |arguments: &arguments::Arguments| &arguments.common, run::run)
}
