//! Reads image, camera and voxels, reconstructs, and writes the volume.

use super::preset::{self, WeightsName};
use super::{arguments::Arguments, misfit};
use lf_core::cli::MemoryLimit;
use lf_core::image::{self, Frame, FrameFiles};
use lf_core::{
    Camera, Error, Grid, Result, Session, Tile, Verdict, Volume, cli, io, volume, weights::aperture_sections,
};
use lf_mart::{Ended, Options, Plan, Reconstruction, Start, Sweep, Until};
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

pub fn main() -> ExitCode {
    cli::run("lf-mart", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    arguments.options(None, || 0.0)?;
    if let Some(preset) = arguments.preset {
        session.explain_preset(preset, preset::typed(preset).into_iter().zip([arguments.iterations.is_none()]));
    }
    check_files(arguments, session)?;
    let name = io::name(&arguments.support);
    let (camera, image, support) = session.phase("read", |_| {
        let camera = Camera::open(&arguments.camera)?;
        let files = FrameFiles { background: arguments.background.as_deref(), mask: arguments.mask.as_deref() };
        let channel = arguments.reading.channel;
        let image = image::open_frame(&arguments.image, files, &camera, &arguments.camera, channel)?;
        Ok((camera, image, Volume::open(&arguments.support)?))
    })?;
    let flat = camera.flat_field(&arguments.camera);
    let flat: Vec<&Path> = flat.as_deref().into_iter().collect();
    session.keep_apart(&arguments.output, &flat)?;
    arguments.log.as_ref().map_or(Ok(()), |log| session.keep_apart(log, &flat))?;
    if support.count() == 0 {
        return Err(Error::new(name, "holds no voxel", "wanted a support with voxels"));
    }
    let start = open_start(arguments, support.grid())?;
    let options = options(arguments, &support, &image, session)?;
    if arguments.weights == WeightsName::Drt {
        let sections = arguments.sections.unwrap_or_else(|| aperture_sections(&camera));
        session.count("sections", sections);
        session.explain(format!("{sections} x {sections} sections of the aperture"));
    }
    let plan = Plan::new(&camera, support.grid(), support.indices(), &options)
        .map_err(|refusal| refusal.about(name.as_str()))?;
    if arguments.estimate {
        let bytes = plan.peak_bytes(image.pixels.len());
        session.print_estimate(bytes, &[("voxels", support.count() as u64)], &[])?;
        return Ok(Verdict::Done);
    }
    session.warn_of_frame(&image, &camera, arguments.background.is_some());
    if camera.blur.is_some() {
        session.warn(format!(
            "the camera blurs light by {:.2} px and the weights here are sharp: intensities are less exact; lf-fit \
             models the blur",
            camera.blur_core_px()
        ));
    }
    session.explain(format!("camera: {}", camera.about()));
    session.explain(plan.about());
    let limit = MemoryLimit { max_memory: Some(arguments.max_memory) };
    let what = || format!("{} voxels", support.count());
    session.allow_memory(limit, plan.peak_bytes(image.pixels.len()) as f64, name.as_str(), what)?;

    let (solved, log) = solve(&plan, &image, start.as_ref(), &options, &name, session)?;
    if solved.indices.is_empty() {
        let wanted = format!("wanted a support that {} can light", io::name(&arguments.image));
        return Err(Error::new(name, "no voxel has light", wanted));
    }
    report(&solved, &options, &support, session);
    misfit::judge(&solved, &options, image.pixels.view(), session);
    session.phase("write", |session| {
        let history = session.history(support.history());
        io::save(&arguments.output, |out| {
            let column = ("intensity", solved.intensity.as_slice());
            volume::write_with(out, support.grid(), &solved.indices, &[column], &history, support.extra())
        })?;
        match &arguments.log {
            Some(file) => io::save_text(file, |out| out.write_all(log.as_bytes())),
            None => Ok(()),
        }
    })?;
    Ok(Verdict::Done)
}

/// Refuses outputs that overwrite inputs or each other, or that cannot be written.
fn check_files(arguments: &Arguments, session: &Session) -> Result<()> {
    let mut inputs = vec![arguments.support.as_path(), arguments.image.as_path(), arguments.camera.as_path()];
    inputs.extend(
        [&arguments.background, &arguments.mask, &arguments.start].into_iter().flat_map(|file| file.as_deref()),
    );
    session.keep_apart(&arguments.output, &inputs)?;
    io::check_place(&arguments.output)?;
    let Some(log) = &arguments.log else { return Ok(()) };
    if io::is_standard(log) && io::is_standard(&arguments.output) {
        return Err(Error::new("standard output", "asked for by --log and by -o", "wanted a file for one of them"));
    }
    session.keep_apart(log, &inputs)?;
    session.keep_apart(log, &[&arguments.output])?;
    io::check_place(log)
}

fn open_start(arguments: &Arguments, grid: &Grid) -> Result<Option<Volume>> {
    let Some(file) = &arguments.start else { return Ok(None) };
    let start = Volume::open(file)?;
    let intensity = start.require("intensity")?;
    if let Some(negative) = intensity.iter().find(|value| **value < 0.0) {
        return Err(Error::new(
            io::name(file),
            format!("an intensity of {negative}"),
            "wanted intensities of 0 or more",
        ));
    }
    if !start.grid().agrees_with(grid) {
        return Err(Error::new(io::name(file), start.grid().to_string(), format!("wanted the support's {grid}")));
    }
    Ok(Some(start))
}

fn options(arguments: &Arguments, support: &Volume, image: &Frame, session: &mut Session) -> Result<Options> {
    let options = arguments.options(Tile::of(support)?, || {
        let sigma = image::noise(image.pixels.view());
        session.explain(format!("noise {sigma:.3} counts"));
        session.count("noise_counts", sigma);
        sigma
    })?;
    if options.tile.is_some() {
        session.explain(format!(
            "a tile: at most {} sweeps, momentum is never reset, voxels are dropped by the strongest near them",
            options.iterations
        ));
    }
    Ok(options)
}

/// Gives the reconstruction, and the log of its sweeps.
fn solve(
    plan: &Plan,
    image: &Frame,
    start: Option<&Volume>,
    options: &Options,
    name: &str,
    session: &mut Session,
) -> Result<(Reconstruction, String)> {
    let mut log = String::new();
    let solved = session.phase("reconstruct", |session| {
        let what = if options.until == Until::Never { "sweeps" } else { "sweeps at most" };
        let progress = session.progress(what, options.iterations as u64);
        let began = Instant::now();
        let done = |sweep: &Sweep| {
            progress.add(1);
            let Sweep { number, misfit, change, voxels, weights } = *sweep;
            let seconds = began.elapsed().as_secs_f64();
            session.explain(format!("sweep {number}: misfit {misfit:.4}, change {change:.4}, {voxels} voxels held"));
            log += &json!({"iteration": number, "misfit": misfit, "change": change, "voxels": voxels,
                "weights": weights, "seconds": seconds})
            .to_string();
            log.push('\n');
        };
        let start =
            start.and_then(|start| Some(Start { indices: start.indices(), intensity: start.column("intensity")? }));
        plan.solve(image.pixels.view(), start, done).map_err(|refusal| refusal.about(name))
    })?;
    Ok((solved, log))
}

fn report(solved: &Reconstruction, options: &Options, support: &Volume, session: &mut Session) {
    if solved.clipped > 0 {
        session.warn(format!(
            "{} voxels are brighter than {:.1e} counts, the most that a volume can hold, and get that; scale the image down",
            solved.clipped,
            f32::MAX
        ));
    }
    let (sweeps, misfit) = solved.sweeps.last().map_or((0, 0.0), |sweep| (sweep.number, sweep.misfit));
    session.explain(match options.ended(&solved.sweeps) {
        Ended::Most => format!("ended after {sweeps} sweeps, the number of --iterations"),
        Ended::Stalled => {
            format!("ended after {sweeps} sweeps: the last two lowered the misfit by less than a hundredth")
        }
        Ended::Reached => format!("ended after {sweeps} sweeps: the misfit is as low as --until asks"),
    });
    session.count("support_voxels", support.count());
    session.count("unseen_voxels", solved.unseen);
    session.count("lit_voxels", solved.indices.len());
    session.count("sweeps", sweeps);
    session.count("misfit", misfit);
    session.count("weights_touched", solved.sweeps.iter().map(|sweep| sweep.weights).sum::<u64>());
    session.explain(format!(
        "{} voxels, {} unseen; misfit {misfit:.4} in the last of {sweeps} sweeps; {} voxels lit",
        support.count(),
        solved.unseen,
        solved.indices.len()
    ));
}
