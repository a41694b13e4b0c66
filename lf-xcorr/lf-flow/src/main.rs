//! lf-flow: measured fields to flows and what follows from them.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    lf_core::cli::run("lf-flow", |arguments: &cli::Arguments| &arguments.common, cli::run)
}
