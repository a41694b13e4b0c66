//! Runs the task that was asked for.

use super::arguments::{Arguments, Task};
use super::{
    background::background, frame::frame, lattice::lattice, main_lens::main_lens, noise::noise, nominal::nominal,
    refine::refine,
};
use lf_core::cli;
use std::process::ExitCode;

pub fn run() -> ExitCode {
    cli::run(
        "lf-calib",
        |arguments: &Arguments| &arguments.common,
        |arguments, session| match &arguments.task {
            Task::Nominal(arguments) => nominal(arguments, session),
            Task::Lattice(arguments) => lattice(arguments, session),
            Task::Volume(arguments) => main_lens(arguments, session),
            Task::Refine(arguments) => refine(arguments, session),
            Task::Noise(arguments) => noise(arguments, session),
            Task::Background(arguments) => background(arguments, session),
            Task::Frame(arguments) => frame(arguments, session),
        },
    )
}
