//! From the command line to its task.

use super::arguments::{Arguments, Task};
use super::{dots, frames, scene, white};
use lf_core::{Result, Session, Verdict, cli};
use std::process::ExitCode;

pub fn main() -> ExitCode {
    cli::run("lf-synth", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    match &arguments.task {
        Task::Scene { name, set } => scene::print(name.as_deref(), set),
        Task::Frames(arguments) => frames::render(arguments, session),
        Task::White { source, output } => white::white(source, output, session),
        Task::Dark { source, output } => white::dark(source, output, session),
        Task::Dots { source, output, format } => dots::render(source, output, *format, session),
    }?;
    Ok(Verdict::Done)
}
