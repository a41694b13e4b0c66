//! lf-prune: image and camera to the voxels that may hold light.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
