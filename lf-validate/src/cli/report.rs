//! `report`: a page that shows a run.

use lf_core::{Result, Session, Verdict, io};
use lf_validate::report::{self, Options};
use std::path::{Path, PathBuf};

/// A page that shows a run, in one file for any browser
///
/// Takes the folder of scripts/pipeline.mk, or any folder with camera.json, support-*.lfv,
/// volume-*.lfv, particles-*.csv, field-*.exr, *.stats.json and log/*.txt; what is missing is left
/// out. The page shows, in this order: warnings of all logs; the field, layer by layer, with a
/// choice of colours; statistics and histograms; particles by depth and the bound of their
/// precision; misfit and light by depth; what pruning kept; raw frame and white image with the
/// lattice; camera and calibration; time and memory; the commands.
///
/// The file needs no network and stays below 5 MB: of many fields it holds those that fit.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate report . -o report.html
  lf-validate report . -o report.html --white white.exr --title 'A first run'"
)]
pub struct Arguments {
    /// The folder of the run
    folder: PathBuf,
    /// Where the page goes
    #[arg(short, long, value_name = "FILE.html", default_value = "-")]
    output: PathBuf,
    /// A raw frame to show [default: the one that the first volume was made from]
    #[arg(long, value_name = "IMAGE")]
    frame: Option<PathBuf>,
    /// A white image to show
    #[arg(long, value_name = "IMAGE")]
    white: Option<PathBuf>,
    /// Heading of the page [default: the folder's name]
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
}

/// Writes the page.
pub fn write(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let images: Vec<&Path> = [&arguments.frame, &arguments.white].into_iter().flatten().map(PathBuf::as_path).collect();
    session.keep_apart(&arguments.output, &images)?;
    io::check_place(&arguments.output)?;
    let options =
        Options { frame: arguments.frame.clone(), white: arguments.white.clone(), title: arguments.title.clone() };
    let made = session.phase("read", |_| {
        let refused = |refusal: lf_core::Refusal| refusal.about(arguments.folder.display().to_string());
        report::report(&arguments.folder, &options).map_err(refused)
    })?;
    made.unread.iter().for_each(|line| session.warn(format!("left out: {line}")));
    session.count("bytes", made.html.len());
    session.count("sections", made.sections);
    session.count("warnings", made.warnings);
    io::save_text(&arguments.output, |out| out.write_all(made.html.as_bytes()))?;
    Ok(Verdict::Done)
}
