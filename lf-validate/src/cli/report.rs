//! `report`: a page that shows a run.

use lf_core::cli::{MemoryLimit, check_memory};
use lf_core::{Error, Field, Result, Session, Verdict, Volume, image, io};
use lf_validate::report::{self, PageOptions, Source};
use ndarray::Array2;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A page that shows a run, in one file for any browser
///
/// Takes the folder of scripts/pipeline.mk, or any folder with camera.json, support-*.lfv,
/// volume-*.lfv, particles-*.csv, field-*.exr, *.stats.json and log/*.txt; what is missing is left
/// out. The page shows, in this order: warnings of all logs; the field, layer by layer, with a
/// choice of colours; the volume in three dimensions; statistics and histograms; particles by depth
/// and the bound of their precision; misfit and light by depth; what pruning kept; raw frame and
/// white image with the lattice; camera and calibration; time and memory; the commands.
///
/// The file needs no network. Its fields take 3.6 MB at most: of many fields it holds those that fit.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate report . -o report.html
  lf-validate report . -o report.html --white white.exr --title 'A first run'"
)]
pub struct ReportArguments {
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
pub fn write(arguments: &ReportArguments, limit: MemoryLimit, session: &mut Session) -> Result<Verdict> {
    let folder = RunFolder::open(&arguments.folder, limit)?;
    let typed = |file: &PathBuf| file.display().to_string();
    let options = PageOptions {
        frame: arguments.frame.as_ref().map(typed).or_else(|| folder.frame()),
        white: arguments.white.as_ref().map(typed),
        title: arguments.title.clone().unwrap_or_else(|| folder.heading()),
    };
    let images = [&options.frame, &options.white].into_iter().flatten().map(PathBuf::from);
    let inputs: Vec<PathBuf> = report::inputs(&folder.names).map(|name| folder.path.join(name)).chain(images).collect();
    session.keep_apart(&arguments.output, &inputs.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    io::check_place(&arguments.output)?;
    let made = session.phase("read", |_| {
        report::report(&folder, &options).map_err(|refusal| refusal.about(io::name(&arguments.folder)))
    })?;
    made.unread.iter().for_each(|line| session.warn(format!("left out: {line}")));
    session.count("bytes", made.html.len());
    session.count("sections", made.sections);
    session.count("warnings", made.warnings);
    io::save_text(&arguments.output, |out| out.write_all(made.html.as_bytes()))?;
    Ok(Verdict::Done)
}

/// The folder of a run.
struct RunFolder {
    path: PathBuf,
    names: BTreeSet<String>,
    limit: MemoryLimit,
}

impl RunFolder {
    /// Lists the files of a folder, and those of `log` in it.
    fn open(path: &Path, limit: MemoryLimit) -> Result<Self> {
        let wanted = "wanted the folder of a run";
        let entries = fs::read_dir(path).map_err(|_| Error::new(io::name(path), "no such folder", wanted))?;
        let logs = fs::read_dir(path.join("log")).into_iter().flatten();
        let file = |entry: fs::DirEntry, folder: &str| {
            let name = entry.path().is_file().then(|| entry.file_name().to_string_lossy().into_owned());
            name.map(|name| format!("{folder}{name}"))
        };
        let own = entries.flatten().filter_map(|entry| file(entry, ""));
        let names = own.chain(logs.flatten().filter_map(|entry| file(entry, "log/"))).collect();
        Ok(Self { path: path.to_owned(), names, limit })
    }

    fn heading(&self) -> String {
        let whole = self.path.canonicalize().unwrap_or_else(|_| self.path.clone());
        let name = whole.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        format!("Light-field PIV: {name}")
    }

    /// The image that the first volume was made from, by its history: as it was typed, or beside the folder.
    fn frame(&self) -> Option<String> {
        let first = self.names.iter().find(|name| name.starts_with("volume-") && name.ends_with(".lfv"))?;
        let volume = self.volume(first).ok()?;
        let step = volume.history().iter().rev().find(|step| ["lf-fit", "lf-mart"].contains(&step.tool.as_str()))?;
        let typed = step.option(["-i", "--image"])?;
        let beside = [None, Some(self.path.as_path()), self.path.parent()];
        let mut places =
            beside.into_iter().map(|folder| folder.map_or(PathBuf::from(typed), |folder| folder.join(typed)));
        places.find(|place| io::split_page(place).0.is_file()).map(|place| place.display().to_string())
    }
}

impl Source for RunFolder {
    fn names(&self) -> &BTreeSet<String> {
        &self.names
    }

    fn text(&self, name: &str) -> Result<String> {
        io::open_text(&self.path.join(name))
    }

    fn field(&self, name: &str) -> Result<Field> {
        Field::open(&self.path.join(name))
    }

    fn volume(&self, name: &str) -> Result<Volume> {
        Volume::open(&self.path.join(name))
    }

    fn allow(&self, bytes: f64, name: &str, what: &str) -> Result<()> {
        check_memory(self.limit, bytes, name, || what.to_owned())
    }

    fn image(&self, name: &str) -> Result<Array2<f32>> {
        Ok(image::open_counts(Path::new(name), None)?.pixels)
    }
}
