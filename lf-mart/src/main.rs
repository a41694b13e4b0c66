//! lf-mart: image, camera and voxels to intensities.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
