//! lf-refocus: a stage of your own, to be copied. It takes the place of lf-mart:
//!
//! ```text
//! cargo build --release -p lf-refocus
//! make -f scripts/pipeline.mk MART=target/release/lf-refocus
//! ```
//!
//! How to begin:
//!
//! 1. Copy this folder, change the `name` in its `Cargo.toml`, and add it to `members` in the workspace's. Outside the
//!    workspace, name lf-core by its path (`lf-core = { path = "../lf/lf-core" }`), other crates by their versions.
//! 2. Keep files and words in `cli.rs`. [`lf_core::cli::run`] brings exit codes, errors of one line, `--threads`,
//!    `--stats`, `--quiet` and `--verbose`. [`lf_core::volume::write`] and [`lf_core::io::save`] write a file whole or
//!    not at all, with the history of how it was made.
//! 3. Put the work into `lib.rs`, where a test can reach it: slices and arrays in, owned values out.
//!
//! `scripts/pipeline.mk` shows the options that the stage must take.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
