//! `ensemble`: many fields of one flow.

use super::inputs::check_inputs;
use super::picture::Picture;
use super::print::print;
use lf_core::cli::{Session, Verdict};
use lf_core::field::{self, Cut, Field};
use lf_core::{Error, Result, io};
use lf_validate::pictures;
use lf_validate::scores::ensemble::{Ensemble, EnsembleSums};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// Fields whose vectors stand at the same places
    #[arg(required = true)]
    fields: Vec<PathBuf>,
    /// Write the mean (.exr, .csv), or all statistics (.vti); may be given several times
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Fewest measured vectors of a place; with fewer it is without data
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    least: u32,
    #[command(flatten)]
    picture: Picture,
    /// Which slice is drawn: the axis it stands across, and where (mm; the nearest layer), as z=0.5 [default: z, its middle]
    #[arg(long, value_name = "AXIS[=MM]")]
    slice: Option<Cut>,
}

/// Reads one after another, averages, writes.
pub fn average(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let inputs: Vec<&Path> = arguments.fields.iter().map(PathBuf::as_path).collect();
    check_inputs(&inputs, session)?;
    arguments.picture.check(&inputs, session)?;
    for (n, output) in arguments.output.iter().enumerate() {
        if io::is_standard(output) {
            return Err(Error::new("--output", "-", "wanted a file: standard output is the summary's"));
        }
        if arguments.output[..n].contains(output) {
            return Err(Error::new(io::output_name(output), "is asked for twice", "wanted another name for each"));
        }
        session.keep_apart(output, &inputs)?;
        io::check_place(output)?;
    }
    let cut = arguments.slice.unwrap_or_default();
    let refused = |refusal: lf_core::Refusal| refusal.about("--slice");
    let progress = session.progress("fields", inputs.len() as u64);
    let mut sums: Option<EnsembleSums> = None;
    let mut history = Vec::new();
    for path in inputs {
        let field = session.phase("read", |_| Field::open(path))?;
        if sums.is_none() {
            cut.layer(&field.layout).map_err(refused)?;
            history = session.history(&field.layout.history);
        }
        let sums = sums.get_or_insert_with(|| EnsembleSums::new(&field.layout));
        session.phase("sum", |_| sums.add(&field).map_err(|refusal| refusal.about(io::name(path))))?;
        progress.add(1);
    }
    drop(progress);
    let sums = sums.ok_or_else(|| Error::new("ensemble", "no field", "wanted at least one"))?;
    let mut found = session.phase("average", |_| Ok(sums.finish(arguments.least)))?;
    found.mean.layout.history = history;
    session.count("fields", found.fields);
    session.count("places", found.mean.len());
    let layer = cut.layer(&found.mean.layout).map_err(refused)?;
    session.phase("write", |_| arguments.output.iter().try_for_each(|path| save(&found, path)))?;
    arguments.picture.draw(session, || pictures::ensemble(&found, cut.axis, layer))?;
    print(&found.summary())?;
    Ok(Verdict::Done)
}

fn save(found: &Ensemble, path: &Path) -> Result<()> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("vti")) {
        return field::save_arrays(path, &found.mean.layout, &found.to_arrays());
    }
    found.mean.save(path)
}
