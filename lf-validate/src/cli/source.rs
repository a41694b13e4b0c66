//! Runs that `curves` and `trade` read, and the options of their pictures.

use super::output::Picture;
use lf_core::{Error, Refusal, Result, Session, io};
use lf_plot::Chart;
use lf_validate::runs::{self, Condition, RunRecord, parse_value};
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct RunSource {
    /// Files of JSON objects, one a run, as `line` writes them; an object may take many lines
    #[arg(default_value = "-", value_name = "RUNS")]
    files: Vec<PathBuf>,
    /// Take only runs with this VALUE of KEY. May be given again; then all must hold
    #[arg(long = "where", value_name = "KEY=VALUE", value_parser = condition)]
    conditions: Vec<Condition>,
    #[command(flatten)]
    picture: Picture,
    /// Title of the picture
    #[arg(long, value_name = "TEXT", requires = "plot")]
    title: Option<String>,
}

impl RunSource {
    /// Reads the runs that meet all conditions. Refuses outputs that are also inputs.
    pub fn records(&self, session: &mut Session) -> Result<Vec<RunRecord>> {
        self.picture.check(&self.files, session)?;
        let read = |path: &PathBuf| {
            let name = io::name(path);
            runs::read_records(&io::open_text(path)?, &name).map_err(|refusal| refusal.about(name))
        };
        let all = session.phase("read", |_| self.files.iter().map(read).collect::<Result<Vec<_>>>())?;
        runs::select(all.concat(), &self.conditions).map_err(|refusal| self.refused(refusal))
    }

    /// Draws the chart if --plot is given.
    pub fn draw(&self, session: &mut Session, chart: impl FnOnce(String) -> Chart) -> Result<()> {
        self.picture.draw(session, || chart(self.title.clone().unwrap_or_default()))
    }

    /// A refusal about all files.
    pub fn refused(&self, refusal: Refusal) -> Error {
        let names: Vec<String> = self.files.iter().map(|path| io::name(path)).collect();
        refusal.about(names.join(" and "))
    }
}

/// Parses `KEY=VALUE`.
fn condition(text: &str) -> std::result::Result<Condition, String> {
    match text.split_once('=') {
        Some((key, value)) if !key.is_empty() => Ok(Condition { key: key.to_owned(), value: parse_value(value) }),
        _ => Err("wanted KEY=VALUE".to_string()),
    }
}
