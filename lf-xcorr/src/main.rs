//! `lf-xcorr`: two sparse volumes to a velocity field.

mod doors;

use doors::arguments::{Arguments, MaskSource, voxels_in};
use doors::report;
use lf_core::cli::{self, Session, Verdict};
use lf_core::volume::Volume;
use lf_core::volume::{JoinedVolume, together};
use lf_core::{Error, Result, io};
use lf_xcorr::plot;
use lf_xcorr::{Mask, Options, Outcome, Side, Sparse};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What is correlated.
const COLUMN: &str = "intensity";

fn main() -> ExitCode {
    cli::run("lf-xcorr", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    if let Some((option, why)) = arguments.idle() {
        return Err(Error::new(option, format!("changes nothing: {why}"), "wanted it left out"));
    }
    let inputs = inputs(arguments);
    session.keep_apart(&arguments.output, &inputs)?;
    io::check_place(&arguments.output)?;
    if let Some(plot) = &arguments.plot {
        io::check_picture(plot)?;
        session.keep_apart(plot, &inputs)?;
        if plot == &arguments.output || io::same_file(plot, &arguments.output) {
            return Err(Error::new(io::output_name(plot), "is the output and the --plot file", "wanted two files"));
        }
    }

    let (volumes, support) = session.phase("read", |_| {
        let volumes = volumes(arguments)?;
        let support = match &arguments.mask {
            Some(MaskSource::Support(path)) => Some(Volume::open(path)?),
            _ => None,
        };
        Ok((volumes, support))
    })?;
    let grid = volumes[0].grid();
    let mask = match (&arguments.mask, &support) {
        (Some(MaskSource::Box(box_mm)), _) => Mask::Box(voxels_in(*box_mm, grid)),
        (_, Some(support)) => {
            if !support.grid().agrees_with(grid) {
                let wanted = format!("wanted that of {}, {grid}", volumes[0].name());
                return Err(Error::new(support.name(), format!("a grid of {}", support.grid()), wanted));
            }
            Mask::Support(support.indices())
        }
        _ => Mask::Everything,
    };
    let part = mask.part(grid).map_err(|error| refused(error, &volumes))?;
    let shape = part.shape;
    let cut = arguments.slice.unwrap_or_default();
    let bounds_mm =
        [-0.5, shape[cut.axis] as f64 - 0.5].map(|i| part.origin_mm[cut.axis] + i * part.spacing_mm[cut.axis]);
    let what = if let Mask::Box(_) = mask { "mask" } else { "volume" };
    cut.check(bounds_mm, what).map_err(|refusal| refusal.about(volumes[0].name()))?;
    let options = arguments.options(&part);
    options.check(shape).map_err(|error| refused(error, &volumes))?;
    arguments.explain_preset(session);
    arguments.passes.tell_millimetres(&part, session);
    arguments.passes.tell_fitted(shape, &options, session);
    if arguments.estimate {
        let bytes = lf_xcorr::estimate_bytes(&pairs(&volumes), &mask, &options);
        let voxels = volumes.iter().map(|volume| volume.indices().len() as u64).sum();
        session.tell_estimate(bytes, &[("voxels", voxels)])?;
        return Ok(Verdict::Done);
    }
    if session.is_verbose() {
        let gigabytes = 1e-9 * lf_xcorr::estimate_bytes(&pairs(&volumes), &mask, &options) as f64;
        session.explain(format!("about {gigabytes:.2} GB of memory beside the volumes; {}", report::passes(&options)));
        session.explain(format!("products by {}", lf_core::simd::Level::detect().name()));
    }
    let windows = lf_xcorr::windows(shape, &options);
    let mut outcome = session.phase("correlate", |session| correlate(&volumes, &mask, &options, windows, session))?;
    let histories = volumes.iter().map(JoinedVolume::history).chain(support.as_ref().map(Volume::history));
    outcome.field.layout.history = session.history(&together(histories));
    outcome.field.layout.dt_s = arguments.dt;
    report::tell(&outcome, &options, session);
    session.phase("write", |_| {
        outcome.field.save(&arguments.output)?;
        // The field is kept even where the volume holds the slice and the field, which is smaller, does not.
        if let Some(path) = &arguments.plot {
            let svg = plot::slice(&outcome.field, cut).map_err(|refusal| refusal.about(io::output_name(path)))?;
            io::save_text(path, |out| out.write_all(svg.as_bytes()))?;
        }
        Ok(())
    })?;
    Ok(Verdict::Done)
}

/// The volumes in pairs, first and second in turn.
fn volumes(arguments: &Arguments) -> Result<Vec<JoinedVolume>> {
    let mut volumes = JoinedVolume::open_all(arguments.files(), COLUMN)?;
    let name = |volumes: &[JoinedVolume]| volumes.iter().map(JoinedVolume::name).collect::<Vec<_>>().join(", ");
    if volumes.len() != 2 {
        let found = format!("{} volumes", volumes.len());
        return Err(Error::new(name(&volumes), found, "wanted two, each a file or all its tiles; more pairs by --and"));
    }
    let more = JoinedVolume::open_all(arguments.and.iter().map(PathBuf::as_path), COLUMN)?;
    if more.len() % 2 == 1 {
        return Err(Error::new(name(&more), format!("{} volumes after --and", more.len()), "wanted pairs"));
    }
    volumes.extend(more);
    Ok(volumes)
}

/// Every file that is read.
fn inputs(arguments: &Arguments) -> Vec<&Path> {
    let mut inputs: Vec<&Path> = arguments.files().chain(arguments.and.iter().map(PathBuf::as_path)).collect();
    if let Some(MaskSource::Support(path)) = &arguments.mask {
        inputs.push(path);
    }
    inputs
}

/// The light of the volumes, pair by pair.
fn pairs<'a>(volumes: &'a [JoinedVolume]) -> Vec<[Sparse<'a>; 2]> {
    let sparse = volumes.iter().map(|volume| Sparse {
        grid: volume.grid(),
        indices: volume.indices(),
        intensity: volume.values(),
    });
    let sparse: Vec<Sparse> = sparse.collect();
    sparse.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
}

fn correlate(
    volumes: &[JoinedVolume],
    mask: &Mask,
    options: &Options,
    windows: u64,
    session: &Session,
) -> Result<Outcome> {
    let pairs = pairs(volumes);
    let progress = session.progress("windows", windows);
    let watch = |windows| progress.add(windows);
    lf_xcorr::correlate_pairs(&pairs, mask, options, &watch).map_err(|error| refused(error, volumes))
}

fn refused(error: lf_xcorr::Error, volumes: &[JoinedVolume]) -> Error {
    let subject = match error.side {
        Side::First(pair) => volumes[2 * pair].name().to_owned(),
        Side::Second(pair) => volumes[2 * pair + 1].name().to_owned(),
        Side::Both => volumes.iter().map(JoinedVolume::name).collect::<Vec<_>>().join(" and "),
        Side::Mask => "--mask".to_owned(),
        Side::Options => "options".to_owned(),
    };
    Error::new(subject, error.found, error.wanted)
}
