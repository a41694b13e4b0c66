//! What `curves` and `trade` read and draw.

use super::inputs::check_inputs;
use super::picture::Picture;
use lf_core::cli::Session;
use lf_core::plot::Chart;
use lf_core::{Error, Result, io};
use lf_validate::runs::{self, Condition, Record, typed};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Source {
    /// Files of JSON objects, one a run: one a line, as `line` writes them, or spread over lines
    #[arg(default_value = "-", value_name = "RUNS")]
    files: Vec<PathBuf>,
    /// Take only runs whose KEY is VALUE; may be given again, then all have to hold
    #[arg(long = "where", value_name = "KEY=VALUE", value_parser = condition)]
    conditions: Vec<Condition>,
    #[command(flatten)]
    picture: Picture,
    /// Title of the picture
    #[arg(long, value_name = "TEXT", requires = "plot")]
    title: Option<String>,
}

impl Source {
    /// The runs that are asked for. Outputs that are also inputs are refused first.
    pub fn records(&self, session: &mut Session) -> Result<Vec<Record>> {
        let inputs: Vec<&Path> = self.files.iter().map(PathBuf::as_path).collect();
        check_inputs(&inputs, session)?;
        self.picture.check(&inputs, session)?;
        let read = |path: &PathBuf| {
            let name = io::name(path);
            runs::records(&io::open_text(path)?, &name).map_err(|(found, wanted)| Error::new(name, found, wanted))
        };
        let all = session.phase("read", |_| self.files.iter().map(read).collect::<Result<Vec<_>>>())?;
        runs::chosen(all.concat(), &self.conditions).map_err(|refusal| self.refused(refusal))
    }

    /// Draws the chart where it is asked for.
    pub fn draw(&self, session: &mut Session, chart: impl FnOnce(String) -> Chart) -> Result<()> {
        self.picture.draw(session, || chart(self.title.clone().unwrap_or_default()))
    }

    /// What the files cannot give.
    pub fn refused(&self, (found, wanted): runs::Refusal) -> Error {
        let names: Vec<String> = self.files.iter().map(|path| io::name(path)).collect();
        Error::new(names.join(" and "), found, wanted)
    }
}

fn condition(text: &str) -> std::result::Result<Condition, String> {
    match text.split_once('=') {
        Some((key, value)) if !key.is_empty() => Ok(Condition { key: key.to_owned(), value: typed(value) }),
        _ => Err("wanted KEY=VALUE".to_string()),
    }
}
