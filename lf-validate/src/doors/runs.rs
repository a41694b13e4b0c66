//! What `curves` and `trade` read and draw.

use super::check_inputs;
use lf_core::cli::Session;
use lf_core::{Error, Result, io};
use lf_validate::plot::{self, Chart};
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
    /// Draw them: an SVG
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Title of the picture
    #[arg(long, value_name = "TEXT", requires = "plot")]
    title: Option<String>,
}

impl Source {
    /// The runs that are asked for. Outputs that are also inputs are refused first.
    pub fn records(&self, session: &mut Session) -> Result<Vec<Record>> {
        let inputs: Vec<&Path> = self.files.iter().map(PathBuf::as_path).collect();
        check_inputs(&inputs, session)?;
        if let Some(plot) = &self.plot {
            session.keep_apart(plot, &inputs)?;
            if io::is_standard(plot) {
                return Err(Error::new("--plot", "standard output, which holds the JSON", "wanted a file"));
            }
        }
        let read = |path: &PathBuf| {
            let name = io::name(path);
            runs::records(&io::open_text(path)?, &name).map_err(|(found, wanted)| Error::new(name, found, wanted))
        };
        let all = session.phase("read", |_| self.files.iter().map(read).collect::<Result<Vec<_>>>())?;
        runs::chosen(all.concat(), &self.conditions).map_err(|refusal| self.refused(refusal))
    }

    /// Draws the chart where it is asked for.
    pub fn draw(&self, session: &mut Session, chart: impl FnOnce(String) -> Chart) -> Result<()> {
        let Some(path) = &self.plot else { return Ok(()) };
        session.phase("plot", |_| {
            let svg = plot::draw(&chart(self.title.clone().unwrap_or_default()))
                .map_err(|(found, wanted)| Error::new(io::output_name(path), found, wanted))?;
            io::save_text(path, |out| out.write_all(svg.as_bytes()))
        })
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
