//! `lf-xcorr`: two sparse volumes to a velocity field.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    lf_core::cli::run("lf-xcorr", |arguments: &cli::Arguments| &arguments.common, cli::run)
}
