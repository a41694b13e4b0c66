//! `ensemble`: many fields of one flow.

use super::output::{Picture, print};
use lf_core::field::{self, Cut};
use lf_core::{Error, Field, Result, Session, Verdict, cli::MemoryLimit, io};
use lf_validate::pictures;
use lf_validate::scores::ensemble::{
    ConvergenceLog, ConvergenceStep, Ensemble, EnsembleSummary, EnsembleSums, fields_for_1_percent,
};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Mean, fluctuations and vorticity of many fields of one flow
///
/// Only measured vectors count: replaced ones repeat their neighbours.
///
/// Outputs, -o and --plot
///   mean.exr      the mean, a field like any other; its uncertainty is that of the mean, from the
///                 scatter of the fields
///   all.vti       for ParaView: mean, RMS and products of the fluctuations, vorticity of the mean,
///                 number of vectors
///   picture       a slice: the mean with arrows, the mean through the slice, RMS of u, v and w, and
///                 the vorticity about the axis through it
///
/// Printed, as RMS over the places along x, y and z
///   displacement_mm  mean displacement
///   fluctuation_mm   fluctuations, with n - 1; the noise of the measurement is part of them
///   uncertainty_mm   standard uncertainty of the mean
///   vorticity        curl of the mean displacement, without unit, or in 1/s if the fields know the
///                    time between their volumes
///   fields, places, no_data, measured_share
///                    number of fields and of places, places with too few measured vectors, and
///                    share of measured vectors in all fields
///   convergence      after 2, 4, 8 ... fields: change_mm, the difference of their mean from the
///                    mean of all, and fluctuation_mm
///   fields_for_1_percent
///                    number of independent fields after which the uncertainty of the mean is 1 %
///                    of the mean displacement
///
/// Averages by phase, spectra and orthogonal modes: scripts/examples/ensemble.py.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate ensemble field-0000-0001.exr -o mean.vti -o mean.exr
  lf-validate ensemble field-*.exr --slice y=0 --plot mean.svg"
)]
pub struct EnsembleArguments {
    /// Fields with their vectors at the same places
    #[arg(required = true)]
    fields: Vec<PathBuf>,
    /// Write the mean (.exr, .csv) or all statistics (.vti). May be given again
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Places with fewer measured vectors have no data
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    least: u32,
    #[command(flatten)]
    picture: Picture,
    /// Slice to draw: the axis across it and its place in mm, as in z=0.5; the nearest layer is drawn. Without
    /// a place, the layer with the strongest signal for its uncertainty is drawn [default: z]
    #[arg(long, value_name = "AXIS[=MM]")]
    slice: Option<Cut>,
}

/// The printed score.
#[derive(Serialize)]
struct EnsembleReport {
    #[serde(flatten)]
    summary: EnsembleSummary,
    convergence: Vec<ConvergenceStep>,
    fields_for_1_percent: [f64; 3],
}

/// Averages fields, read one after another, and writes the statistics.
pub fn average(arguments: &EnsembleArguments, limit: MemoryLimit, session: &mut Session) -> Result<Verdict> {
    let inputs: Vec<&Path> = arguments.fields.iter().map(PathBuf::as_path).collect();
    check_outputs(arguments, &inputs, session)?;
    let cut = arguments.slice.unwrap_or_default();
    let refused = |refusal: lf_core::Refusal| refusal.about("--slice");
    let progress = session.progress("fields", inputs.len() as u64);
    let mut sums: Option<EnsembleSums> = None;
    let (mut history, mut log) = (Vec::new(), ConvergenceLog::default());
    for path in &inputs {
        let field = session.phase("read", |_| Field::open(path))?;
        if sums.is_none() {
            cut.layer(&field.layout).map_err(refused)?;
            history = session.history(&field.layout.history);
            let bytes = EnsembleSums::bytes(&field.layout) + ConvergenceLog::bytes(field.len(), inputs.len());
            session.allow_memory(limit, bytes, io::name(path), || format!("{} places", field.len()))?;
        }
        let sums = sums.get_or_insert_with(|| EnsembleSums::new(&field.layout));
        session.phase("sum", |_| sums.add(&field).map_err(|refusal| refusal.about(io::name(path))))?;
        log.record(sums);
        progress.add(1);
    }
    drop(progress);
    let sums = sums.ok_or_else(|| Error::new("ensemble", "no field", "wanted at least one"))?;
    let mut ensemble = session.phase("average", |_| Ok(sums.finish(arguments.least)))?;
    ensemble.mean.layout.history = history;
    session.count("fields", ensemble.fields);
    session.count("places", ensemble.mean.len());
    let layer = lf_plot::layer(&ensemble.mean, cut).map_err(refused)?;
    // A picture that is refused leaves no file behind.
    let picture = arguments.picture.drawn(session, || pictures::ensemble(&ensemble, cut.axis, layer))?;
    session.phase("write", |_| arguments.output.iter().try_for_each(|path| save(&ensemble, path)))?;
    arguments.picture.save(picture.as_ref())?;
    print(&EnsembleReport {
        summary: ensemble.summary(),
        convergence: log.finish(&ensemble),
        fields_for_1_percent: fields_for_1_percent(&ensemble),
    })?;
    Ok(Verdict::Done)
}

/// Refuses outputs that are inputs, that are named twice, or that cannot be written.
fn check_outputs(arguments: &EnsembleArguments, inputs: &[&Path], session: &Session) -> Result<()> {
    arguments.picture.check(&arguments.fields, session)?;
    for output in &arguments.output {
        if io::is_standard(output) {
            return Err(Error::new("--output", "-", "wanted a file: the summary goes to standard output"));
        }
        session.keep_apart(output, inputs)?;
        io::check_place(output)?;
    }
    let mut known = BTreeSet::new();
    for output in arguments.output.iter().map(PathBuf::as_path).chain(arguments.picture.file()) {
        if !known.insert(place(output)) {
            return Err(Error::new(io::output_name(output), "is asked for twice", "wanted another name for each"));
        }
    }
    Ok(())
}

/// One path for all names of a file that may not exist yet.
fn place(path: &Path) -> PathBuf {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = parent.canonicalize().or_else(|_| std::path::absolute(parent)).unwrap_or_else(|_| parent.to_owned());
    folder.join(path.file_name().unwrap_or_default())
}

fn save(found: &Ensemble, path: &Path) -> Result<()> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("vti")) {
        return field::save_arrays(path, &found.mean.layout, &found.to_arrays());
    }
    found.mean.save(path)
}
