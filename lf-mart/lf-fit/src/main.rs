//! lf-fit: image, camera and volume to particles.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
