//! `lf-xcorr`: two sparse volumes to a velocity field.

use clap::Parser;
use lf_core::cli::{self, Common, Session, Verdict};
use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::history::History;
use lf_core::volume::Volume;
use lf_core::{Error, Result, io};
use lf_xcorr::plot::{self, Cut};
use lf_xcorr::{Options, Outcome, PassReport, Side, Sparse, triple};
use std::path::PathBuf;
use std::process::ExitCode;

/// The paper's final window, voxels.
const WINDOW: [usize; 3] = [160, 160, 16];

/// Two sparse volumes to a velocity field
///
/// Correlates the lit voxels of two volumes of one grid in two passes, large windows first, and writes a displacement
/// vector in millimetres for every window: its components, the correlation at its peak, the ratio to the second peak and a
/// flag (0 measured, 1 replaced from neighbours, 2 no data). Uncertainties are not estimated and written as NaN.
#[derive(Parser)]
#[command(name = "lf-xcorr", version)]
struct Arguments {
    /// First volume (.lfv with a column `intensity`); `-` is standard input
    a: PathBuf,
    /// Second volume
    b: PathBuf,
    /// Where the field goes: .exr, .vti or .csv; `-` is EXR on standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    /// Interrogation window of the last pass, voxels [default: 160,160,16, or the volume where it is smaller]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    window: Option<[usize; 3]>,
    /// Interrogation window of the first pass, voxels [default: twice the window, or the volume where it is smaller]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    initial: Option<[usize; 3]>,
    /// Share of a window that the next one covers too
    #[arg(long, value_name = "SHARE", default_value_t = 0.75)]
    overlap: f64,
    /// Largest displacement the first pass looks for, voxels [default: an eighth of its window, at least 4]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    search: Option<[usize; 3]>,
    /// How far the last pass looks from where the first one points, voxels [default: 4,4,3]
    #[arg(long, value_name = "X,Y,Z", value_parser = whole_triple)]
    refine: Option<[usize; 3]>,
    /// Take voxels below this share of their volume's brightest as dark
    #[arg(long, value_name = "SHARE", default_value_t = Options::FLOOR)]
    floor: f32,
    /// Draw a slice of the field: colours through the plane, arrows in it
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Which slice: the axis it stands across, and where (mm; the nearest layer), as z=0.5 [default: z, its middle]
    #[arg(long, value_name = "AXIS[=MM]", requires = "plot")]
    slice: Option<Cut>,
    #[command(flatten)]
    common: Common,
}

fn whole_triple(text: &str) -> std::result::Result<[usize; 3], String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| <[usize; 3]>::try_from(numbers).ok());
    numbers
        .filter(|numbers| !numbers.contains(&0))
        .ok_or_else(|| "wanted three whole numbers above 0, like 160,160,16".into())
}

fn main() -> ExitCode {
    cli::run("lf-xcorr", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let (a, b) = (arguments.a.as_path(), arguments.b.as_path());
    if io::is_standard(a) && io::is_standard(b) {
        return Err(Error::new("standard input", "named for both volumes", "wanted at most one of them to be -"));
    }
    session.keep_apart(&arguments.output, &[a, b])?;
    if let Some(plot) = &arguments.plot {
        session.keep_apart(plot, &[a, b])?;
        if plot == &arguments.output || io::same_file(plot, &arguments.output) {
            return Err(Error::new(io::output_name(plot), "is the output and the --plot file", "wanted two files"));
        }
    }

    let volumes = session.phase("read", |_| Ok([Volume::open(a)?, Volume::open(b)?]))?;
    let grid = volumes[0].grid();
    let shape = grid.shape;
    let cut = arguments.slice.unwrap_or_default();
    let bounds_mm =
        [-0.5, shape[cut.axis] as f64 - 0.5].map(|i| grid.origin_mm[cut.axis] + i * grid.spacing_mm[cut.axis]);
    cut.check(bounds_mm, "volume").map_err(|(found, wanted)| Error::new(volumes[0].name(), found, wanted))?;
    let options = meant(arguments, shape);
    options.check(shape).map_err(|error| refused(error, &volumes))?;
    tell_clamped(arguments, shape, &options, session);
    let mut outcome = session.phase("correlate", |session| correlate(&volumes, &options, session))?;
    outcome.field.layout.history = session.history(&both(volumes[0].history(), volumes[1].history()));
    tell(&outcome, session);
    session.phase("write", |_| {
        outcome.field.save(&arguments.output)?;
        // The field is kept even where the volume holds the slice and the field, which is smaller, does not.
        if let Some(path) = &arguments.plot {
            let refused = |(found, wanted): plot::Refusal| Error::new(io::output_name(path), found, wanted);
            let svg = plot::slice(&outcome.field, cut).map_err(refused)?;
            io::save_text(path, |out| out.write_all(svg.as_bytes()))?;
        }
        Ok(())
    })?;
    Ok(Verdict::Done)
}

/// What was typed, turned into what is meant for a volume of `shape`.
fn meant(arguments: &Arguments, shape: [usize; 3]) -> Options {
    let fitted = |wanted: [usize; 3]| [0, 1, 2].map(|axis| wanted[axis].min(shape[axis]));
    let window = arguments.window.unwrap_or(fitted(WINDOW));
    let initial = arguments.initial.unwrap_or(fitted(window.map(|n| n.saturating_mul(2))));
    let search = arguments.search.unwrap_or(fitted(initial.map(|n| (n / 8).max(4))));
    let refine = arguments.refine.unwrap_or(fitted(Options::REFINE));
    let options = Options::coarse_to_fine(initial, window, arguments.overlap, search, refine);
    Options { floor: arguments.floor, ..options }
}

/// Warns of a default window that the volume made smaller.
fn tell_clamped(arguments: &Arguments, shape: [usize; 3], options: &Options, session: &Session) {
    let used = options.passes.last().map_or(WINDOW, |pass| pass.window);
    if arguments.window.is_none() && used != WINDOW {
        let (wanted, used, shape) = (triple(WINDOW), triple(used), triple(shape));
        session.warn(format!("the default --window {wanted} does not fit {shape} voxels; used {used}"));
    } else if arguments.window.is_none() && arguments.initial.is_none() {
        let (wanted, used) = (WINDOW.map(|n| 2 * n), options.passes[0].window);
        if used != wanted {
            let (wanted, used, shape) = (triple(wanted), triple(used), triple(shape));
            session.warn(format!("the default --initial {wanted} does not fit {shape} voxels; used {used}"));
        }
    }
}

fn correlate(volumes: &[Volume; 2], options: &Options, session: &Session) -> Result<Outcome> {
    let intensity = [volumes[0].require("intensity")?, volumes[1].require("intensity")?];
    let [a, b] =
        [0, 1].map(|i| Sparse { grid: volumes[i].grid(), indices: volumes[i].indices(), intensity: intensity[i] });
    let progress = session.progress("windows", lf_xcorr::windows(a.grid.shape, options));
    let watch = |windows| progress.add(windows);
    lf_xcorr::correlate_watched(&a, &b, options, &watch).map_err(|error| refused(error, volumes))
}

fn refused(error: lf_xcorr::Error, volumes: &[Volume; 2]) -> Error {
    let [first, second] = volumes.each_ref().map(Volume::name);
    let subject = match error.side {
        Side::First => first.to_owned(),
        Side::Second => second.to_owned(),
        Side::Both => format!("{first} and {second}"),
        Side::Options => "options".to_owned(),
    };
    Error::new(subject, error.found, error.wanted)
}

/// The steps of the first volume, then those of the second that it does not share.
fn both(first: &History, second: &History) -> History {
    first.iter().chain(second.iter().filter(|step| !first.contains(step))).cloned().collect()
}

fn tell(outcome: &Outcome, session: &mut Session) {
    for (number, pass) in outcome.passes.iter().enumerate() {
        session.explain(pass_line(number + 1, pass));
        session.explain(format!(
            "pass {}: {} dark, {} without a peak inside the search, {} outliers; {} of these measured when searched again, \
             {} replaced, {} without data",
            number + 1,
            pass.dark,
            pass.outside,
            pass.outliers,
            pass.recovered,
            pass.replaced,
            pass.no_data
        ));
    }
    let flags = &outcome.field.flag;
    let count = |flag: f32| flags.iter().filter(|&&other| other == flag).count();
    let (measured, replaced) = (count(MEASURED), count(REPLACED));
    if replaced * 5 > flags.len() - count(NO_DATA) {
        session.warn(format!("{replaced} vectors replaced against {measured} measured; try larger windows"));
    }
    session.count("vectors", flags.len());
    session.count("measured", measured);
    session.count("replaced", replaced);
    session.count("no_data", count(NO_DATA));
    if let Some(pass) = outcome.passes.last() {
        session.count("lit_voxels_a", pass.lit[0]);
        session.count("lit_voxels_b", pass.lit[1]);
    }
}

fn pass_line(number: usize, pass: &PassReport) -> String {
    let (bins, unit) = match pass.bin {
        [1, 1, 1] => (String::new(), "voxels"),
        bin => (format!(" in bins of {}", triple(bin)), "bins"),
    };
    format!(
        "pass {number}: windows of {} voxels, {} of them {} voxels apart; search to {} voxels{bins}; {} and {} lit {unit}",
        triple(pass.window),
        triple(pass.nodes),
        triple(pass.step),
        triple(pass.search),
        pass.lit[0],
        pass.lit[1]
    )
}
