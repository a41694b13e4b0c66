//! lf-fit: image, camera and volume to particles.

mod arguments;
mod inputs;
mod run;

use std::process::ExitCode;

fn main() -> ExitCode {
    run::main()
}
