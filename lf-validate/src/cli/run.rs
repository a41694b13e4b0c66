//! From the command line to the work of a subcommand.

use super::arguments::{Arguments, Command};
use super::{
    depth, displacement, divergence, elongation, ensemble, export, info, output, particles, precision, quality, report,
    score, self_check, split,
};
use lf_core::cli;
use std::process::ExitCode;

/// Reads the command line, runs the subcommand and returns the exit code.
pub fn run() -> ExitCode {
    cli::run(
        "lf-validate",
        |arguments: &Arguments| &arguments.common,
        |arguments, session| {
            output::show_all(arguments.full);
            let limit = arguments.memory;
            match &arguments.command {
                Command::Quality(arguments) => quality::judge(arguments, limit, session),
                Command::Elongation(arguments) => elongation::judge(arguments, session),
                Command::Particles(arguments) => particles::judge(arguments, session),
                Command::Depth(arguments) => depth::judge(arguments, limit, session),
                Command::Displacement(arguments) => displacement::judge(arguments, session),
                Command::Divergence(arguments) => divergence::judge(arguments, session),
                Command::Ensemble(arguments) => ensemble::average(arguments, limit, session),
                Command::Precision(arguments) => precision::judge(arguments, session),
                Command::Score(arguments) => score::judge(arguments, session),
                Command::Split(arguments) => split::write(arguments, session),
                Command::SelfCheck(arguments) => self_check::judge(arguments, session),
                Command::Info(arguments) => info::describe(arguments, session),
                Command::Export(arguments) => export::write(arguments, limit, session),
                Command::Report(arguments) => report::write(arguments, limit, session),
            }
        },
    )
}
