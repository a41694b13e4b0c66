//! Reads image, camera and volume, fits, and writes particles, volume, camera and log.

use super::arguments::Arguments;
use glam::DMat3;
use lf_core::image::{self, Frame};
use lf_core::particles::{self, Particle, Uncertainty};
use lf_core::volume::Tile;
use lf_core::{Camera, Error, Result, Session, Verdict, Volume, cli, io, volume};
use lf_mart::fit::{self, Fit, FitOptions, Found, Progress, Spot};
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

pub fn main() -> ExitCode {
    cli::run("lf-fit", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let options = arguments.options()?;
    check_files(arguments, session)?;
    let name = io::name(&arguments.volume);
    let (camera, image, volume) = session.phase("read", |_| {
        let camera = Camera::open(&arguments.camera)?;
        let (background, channel) = (arguments.background.as_deref(), arguments.reading.channel);
        let image = image::open_signed_frame(&arguments.image, background, &camera, &arguments.camera, channel)?;
        Ok((camera, image, Volume::open(&arguments.volume)?))
    })?;
    let flat = camera.flat_field(&arguments.camera);
    let flat: Vec<&Path> = flat.as_deref().into_iter().collect();
    outputs(arguments).into_iter().try_for_each(|output| session.keep_apart(output, &flat))?;
    volume.require("intensity")?;
    if volume.count() == 0 {
        return Err(Error::new(name, "holds no voxel", "wanted a volume with light"));
    }
    if let Some(tile) = Tile::of(&volume)? {
        let found = format!("tile {} of {}", tile.index, tile.of);
        return Err(Error::new(name, found, "wanted a whole volume: the image also has the light of the other tiles"));
    }
    if image.pixels.iter().all(|value| *value <= 0.0) {
        return Err(Error::new(io::name(&arguments.image), "no pixel has light", "wanted an image of particles"));
    }
    let voxels = (volume.grid(), volume.indices(), volume.column("intensity").unwrap_or_default());
    let work = fit::peak_bytes(&camera, voxels, &options).map_err(|refusal| refusal.about(&name))?;
    if arguments.estimate {
        session.tell_estimate(work, &[("voxels", volume.count() as u64)])?;
        return Ok(Verdict::Done);
    }
    session.allow_memory(arguments.memory, work as f64, &name, || format!("a fit to {} voxels", volume.count()))?;
    session.warn_of_frame(&image, &camera, arguments.background.is_some());
    session.explain(format!("camera: {}", camera.about()));
    let (found, log) = solve(&camera, &image, &volume, &options, &name, session)?;
    report(&found, &options, session);
    session.phase("write", |session| write(arguments, &camera, &volume, &found, &log, session))?;
    Ok(Verdict::Done)
}

/// The files to write.
fn outputs(arguments: &Arguments) -> Vec<&Path> {
    let optional = [&arguments.output, &arguments.camera_out, &arguments.log];
    std::iter::once(&arguments.particles).chain(optional.into_iter().flatten()).map(|path| path.as_path()).collect()
}

/// Refuses outputs that overwrite inputs or each other, or that cannot be written.
fn check_files(arguments: &Arguments, session: &Session) -> Result<()> {
    let mut inputs = vec![arguments.volume.as_path(), arguments.image.as_path(), arguments.camera.as_path()];
    inputs.extend(arguments.background.as_deref());
    let outputs = outputs(arguments);
    if outputs.iter().filter(|output| io::is_standard(output)).count() > 1 {
        return Err(Error::new("standard output", "asked for more than once", "wanted --particles FILE"));
    }
    for (n, output) in outputs.iter().enumerate() {
        session.keep_apart(output, &inputs)?;
        session.keep_apart(
            output,
            &outputs[..n].iter().copied().filter(|other| !io::is_standard(other)).collect::<Vec<_>>(),
        )?;
        io::check_place(output)?;
    }
    Ok(())
}

/// Fits; gives the particles and the log of the steps.
fn solve(
    camera: &Camera,
    image: &Frame,
    volume: &Volume,
    options: &FitOptions,
    name: &str,
    session: &mut Session,
) -> Result<(Fit, String)> {
    let mut log = String::new();
    let found = session.phase("fit", |session| {
        let intensity = volume.column("intensity").unwrap_or_default();
        let voxels = (volume.grid(), volume.indices(), intensity);
        let began = Instant::now();
        let told = |step: &Progress| {
            let Progress { what, particles, changes: [dropped, split, added], gain, misfit, shape, noise } = *step;
            let [x, y] = shape.drift_px;
            let read = noise.read_variance.sqrt();
            let seconds = began.elapsed().as_secs_f64();
            session.explain(format!(
                "{what}: {particles} particles, {dropped} dropped, {split} split, {added} added or moved; chi2 {misfit:.3}, size \
                 {:.4} px, drift ({x:.4}, {y:.4}) px, gain {:.3}, read noise {read:.3} counts; {seconds:.1} s",
                shape.sigma_px, noise.gain
            ));
            log += &json!({"step": what, "particles": particles, "dropped": dropped, "split": split, "added": added,
                "gain_2logl": gain, "chi2": misfit, "size_px": shape.sigma_px, "drift_px": shape.drift_px,
                "gain_counts": noise.gain, "read_noise_counts": read, "seconds": seconds})
            .to_string();
            log.push('\n');
        };
        fit::fit(camera, image.pixels.view(), voxels, options, told).map_err(|refusal| refusal.about(name))
    })?;
    Ok((found, log))
}

fn report(found: &Fit, options: &FitOptions, session: &mut Session) {
    let [x, y] = found.shape.drift_px;
    session.count("particles", found.particles.len());
    session.count("size_px", found.shape.sigma_px);
    session.count("drift_px", json!([x, y]));
    // JSON has no infinity: null says that nothing is known.
    let [size, dx, dy] = found.shape_std_px;
    session.count("size_std_px", json!(size));
    session.count("drift_std_px", json!([dx, dy]));
    session.count("chi2", found.misfit);
    session.count("gain_counts", found.noise.gain);
    session.count("read_noise_counts", found.noise.read_variance.sqrt());
    if options.free.drift && x.hypot(y) > DRIFT_PX {
        session.warn(format!(
            "the lattice has drifted by ({x:.3}, {y:.3}) px against the camera; the fit allows for it; run lf-calib refine, \
             or write the camera with --camera-out"
        ));
    }
}

/// Drift that spoils a reconstruction, px: 0.2 px leave ghosts, and vectors in depth twice as wrong.
const DRIFT_PX: f64 = 0.1;

/// Length of a drawn particle along z over its width: that of the truth of lf-synth.
const LENGTH: f64 = 10.0;
/// Least standard deviation of a drawn particle, voxels: a smaller one falls between them.
const LEAST_DRAWN: f64 = 0.3;

fn write(
    arguments: &Arguments,
    camera: &Camera,
    volume: &Volume,
    found: &Fit,
    log: &str,
    session: &mut Session,
) -> Result<()> {
    let history = session.history(volume.history());
    if let Some(file) = &arguments.output {
        let spots: Vec<Spot> = found.particles.iter().map(|found| found.spot).collect();
        let grid = volume.grid();
        let sigma_mm = found.shape.sigma_px * camera.pixel_in_focus_mm();
        let [dx, dy, dz] = grid.spacing_mm;
        let sizes = [sigma_mm / dx, sigma_mm / dy, LENGTH * sigma_mm / dz].map(|size| size.max(LEAST_DRAWN));
        let (indices, intensity) = fit::draw(grid, &spots, sizes);
        io::save(file, |out| {
            let column = ("intensity", intensity.as_slice());
            volume::write_with(out, grid, &indices, &[column], &history, volume.extra())
        })?;
    }
    let comments: Vec<String> = history.iter().map(|step| json!(step).to_string()).collect();
    let table: Vec<Particle> =
        found.particles.iter().enumerate().map(|(id, found)| particle(arguments.frame, id, found)).collect();
    io::save_text(&arguments.particles, |out| particles::write(out, &comments, &table))?;
    if let Some(file) = &arguments.camera_out {
        let moved = found.shape.camera(camera);
        io::save_text(file, |out| writeln!(out, "{}", moved.to_json()))?;
    }
    match &arguments.log {
        Some(file) => io::save_text(file, |out| out.write_all(log.as_bytes())),
        None => Ok(()),
    }
}

fn particle(frame: usize, id: usize, found: &Found) -> Particle {
    let [xx, xy, xz, yy, yz, zz] = found.covariance_mm2;
    let covariance_mm2 = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    let uncertainty = Some(Uncertainty { covariance_mm2, intensity: found.light_std });
    Particle { frame, id: id as u64, place_mm: found.spot.place_mm, intensity: found.spot.light, uncertainty }
}
