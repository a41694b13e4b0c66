//! From the command line to its task.

use super::arguments::{Arguments, Task};
use super::{calibration, frames, images::save_text, setup};
use lf_core::{Error, Result, Session, Verdict, cli};
use lf_synth::scene::ready::{self, READY};
use std::path::Path;
use std::process::ExitCode;

pub fn main() -> ExitCode {
    cli::run("lf-synth", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    match &arguments.task {
        Task::Scene { name, set } => print_scene(name.as_deref(), set),
        Task::Frames(arguments) => frames::render(arguments, session),
        Task::White(arguments) => calibration::white(arguments, session),
        Task::Dark(arguments) => calibration::dark(arguments, session),
        Task::Dots { source, output, format } => calibration::dots(source, output, *format, session),
    }?;
    Ok(Verdict::Done)
}

/// Prints a ready scene with keys set, or a list of all.
fn print_scene(name: Option<&str>, set: &[String]) -> Result<()> {
    let text = match name {
        Some(name) => changed_scene(name, set)?,
        None => READY.iter().map(|(name, about, _)| format!("{name:16}{about}\n")).collect(),
    };
    save_text(Path::new("-"), &text)
}

fn changed_scene(name: &str, set: &[String]) -> Result<String> {
    let wanted = || format!("wanted one of {}", READY.map(|(name, ..)| name).join(", "));
    let mut scene = ready::scene(name).ok_or_else(|| Error::new(name, "not a ready scene", wanted()))?;
    for assignment in set {
        ready::set(&mut scene, assignment).map_err(|refusal| refusal.about("--set"))?;
    }
    setup::check(&scene).map_err(|found| Error::new("--set", found, "wanted keys and values that a scene.json has"))?;
    Ok(format!("{}\n", serde_json::to_string_pretty(&scene).expect("a scene is plain data")))
}
