//! The option `--plot`, the same for every score.

use lf_core::plot::{self, Chart};
use lf_core::{Error, Result, Session, io};
use std::path::{Path, PathBuf};

/// Where the picture goes.
#[derive(clap::Args)]
pub struct Picture {
    /// Draw the result
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

impl Picture {
    /// Refuses standard input named twice, and any output that is also an input: standard output, `--stats` or the
    /// picture. Refuses a picture on standard output, which is the score's.
    pub fn check(&self, inputs: &[&Path], session: &Session) -> Result<()> {
        session.keep_apart(Path::new("-"), inputs)?;
        let Some(file) = &self.plot else { return Ok(()) };
        if io::is_standard(file) {
            return Err(Error::new("--plot", "-", "wanted a file: standard output is the score's"));
        }
        io::check_picture(file)?;
        session.keep_apart(file, inputs)
    }

    /// Draws and saves the chart if `--plot` is given.
    pub fn draw(&self, session: &mut Session, chart: impl FnOnce() -> Chart) -> Result<()> {
        let Some(file) = &self.plot else { return Ok(()) };
        session.phase("plot", |_| {
            let svg = plot::draw(&chart()).map_err(|refusal| refusal.about(io::output_name(file)))?;
            io::save_text(file, |out| out.write_all(svg.as_bytes()))
        })
    }
}
