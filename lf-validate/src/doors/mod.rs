//! What each score reads and writes.

pub mod curves;
pub mod displacement;
pub mod info;
pub mod line;
pub mod quality;
mod runs;
pub mod trade;

use lf_core::cli::{Session, Verdict};
use lf_core::{Error, Result, io};
use lf_validate::json;
use serde::Serialize;
use std::path::Path;

/// Refuses standard input asked for twice, and a standard output or `--stats` that is also an input.
fn check_inputs(inputs: &[&Path], session: &Session) -> Result<()> {
    one_standard_input(inputs)?;
    session.keep_apart(Path::new("-"), inputs)
}

fn one_standard_input(inputs: &[&Path]) -> Result<()> {
    if inputs.iter().filter(|input| io::is_standard(input)).count() > 1 {
        return Err(Error::new("-", "standard input is asked for twice", "wanted a file for all inputs but one"));
    }
    Ok(())
}

/// One score on standard output.
fn print(score: &impl Serialize) -> Result<()> {
    let text = json::text(score).map_err(|error| Error::new("-", error.to_string(), "wanted a score"))?;
    io::save_text(Path::new("-"), |out| out.write_all(text.as_bytes()))
}

fn verdict(is_yes: bool) -> Verdict {
    if is_yes { Verdict::Done } else { Verdict::No }
}

fn number(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "wanted a number".to_string())?;
    if value.is_finite() { Ok(value) } else { Err("wanted a finite number".to_string()) }
}
