//! From the subcommand to its work.

use super::arguments::{Arguments, Command};
use super::{profile, treat};
use lf_core::{Result, Session, Verdict};

pub fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let limit = arguments.memory;
    match &arguments.command {
        Command::Smooth(arguments) => treat::smooth(arguments, limit, session),
        Command::Solenoidal(arguments) => treat::solenoidal(arguments, limit, session),
        Command::Derive(arguments) => treat::derive(arguments, limit, session),
        Command::Pressure(arguments) => treat::pressure(arguments, limit, session),
        Command::Profile(arguments) => profile::run(arguments, limit, session),
    }?;
    Ok(Verdict::Done)
}
