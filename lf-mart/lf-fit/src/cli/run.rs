//! Reads images, cameras and volumes, fits, and writes particles, volume, cameras and log.

use super::arguments::Arguments;
use super::inputs::{self, Input};
use glam::DMat3;
use lf_core::camera::Pose;
use lf_core::particles::{self, Particle, Uncertainty};
use lf_core::{Camera, Error, Result, Session, Verdict, cli, io, volume};
use lf_fit::{self as fit, CameraFit, Fit, FitOptions, Found, Noise, Progress, Sight, Spot, Together};
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

pub fn main() -> ExitCode {
    cli::run("lf-fit", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let options = arguments.options()?;
    arguments.check_counts()?;
    check_files(arguments, session)?;
    let inputs = inputs::open(arguments, session)?;
    inputs::check(&inputs, arguments, &outputs(arguments), session)?;
    let work = peak_bytes(&inputs, &options)?;
    let voxels: usize = inputs.iter().map(|input| input.volume.count()).sum();
    if arguments.estimate {
        session.print_estimate(work, &[("voxels", voxels as u64)], &[])?;
        return Ok(Verdict::Done);
    }
    session.allow_memory(arguments.memory, work as f64, &inputs[0].name, || format!("a fit to {voxels} voxels"))?;
    for input in &inputs {
        session.warn_of_frame(&input.image, &input.camera, !arguments.background.is_empty());
        session.explain(format!("camera: {}", input.camera.about()));
    }
    let (found, log) = solve(&inputs, &options, session)?;
    report(&found.fit, &options, session);
    report_cameras(&found, &inputs, session);
    session.phase("write", |session| write(arguments, &inputs, &found, &log, session))?;
    Ok(Verdict::Done)
}

/// Bytes that the fit takes.
fn peak_bytes(inputs: &[Input], options: &FitOptions) -> Result<u64> {
    if let [input] = inputs {
        return fit::peak_bytes(&input.camera, input.voxels(), options).map_err(|refusal| refusal.about(&input.name));
    }
    let sights: Vec<Sight> = inputs.iter().map(Input::sight).collect();
    fit::together_bytes(&sights, options).map_err(|(n, refusal)| refusal.about(&inputs[n].name))
}

/// The files to write.
fn outputs(arguments: &Arguments) -> Vec<&Path> {
    let optional = arguments.output.iter().chain(&arguments.camera_out).chain(&arguments.log);
    std::iter::once(&arguments.particles).chain(optional).map(|path| path.as_path()).collect()
}

/// Refuses outputs that overwrite inputs or each other, or that cannot be written.
fn check_files(arguments: &Arguments, session: &Session) -> Result<()> {
    let Arguments { volume, image, camera, background, .. } = arguments;
    let inputs: Vec<&Path> =
        [volume, image, camera, background].into_iter().flatten().map(|path| path.as_path()).collect();
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

/// Fits; gives the particles, the cameras if there are several, and the log of the steps.
fn solve(inputs: &[Input], options: &FitOptions, session: &mut Session) -> Result<(Together, String)> {
    let mut log = String::new();
    let found = session.phase("fit", |session| {
        let began = Instant::now();
        let mut told = |camera: Option<usize>, step: &Progress| {
            let (text, mut line) = told(step, began.elapsed().as_secs_f64());
            let name = camera.map(|n| &inputs[n].camera_name);
            session.explain(name.map_or(String::new(), |name| format!("{name}: ")) + &text);
            if let Some(name) = name {
                line["camera"] = json!(name);
            }
            log += &line.to_string();
            log.push('\n');
        };
        if let [input] = inputs {
            let view = input.image.pixels.view();
            let fitted = fit::fit(&input.camera, view, input.voxels(), options, |step| told(None, step));
            let fit = fitted.map_err(|refusal| refusal.about(&input.name))?;
            return Ok(Together { fit, cameras: Vec::new() });
        }
        let sights: Vec<Sight> = inputs.iter().map(Input::sight).collect();
        fit::fit_together(&sights, options, told).map_err(|(n, refusal)| refusal.about(&inputs[n].camera_name))
    })?;
    Ok((found, log))
}

/// A step in words and as a line of the log.
fn told(step: &Progress, seconds: f64) -> (String, Value) {
    let Progress { what, particles, changes: [dropped, split, added], gain, misfit, shape, noise } = *step;
    let [x, y] = shape.drift_px;
    let read = noise.read_variance.sqrt();
    let text = format!(
        "{what}: {particles} particles, {dropped} dropped, {split} split, {added} added or moved; chi2 {misfit:.3}, size \
         {:.4} px, drift ({x:.4}, {y:.4}) px, gain {:.3}, read noise {read:.3} counts; {seconds:.1} s",
        shape.sigma_px, noise.gain
    );
    let line = json!({"step": what, "particles": particles, "dropped": dropped, "split": split, "added": added,
        "gain_2logl": gain, "chi2": misfit, "size_px": shape.sigma_px, "drift_px": shape.drift_px,
        "gain_counts": noise.gain, "read_noise_counts": read, "seconds": seconds});
    (text, line)
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
        session.warn(drifted("", [x, y]));
    }
}

fn drifted(camera: &str, [x, y]: [f64; 2]) -> String {
    format!(
        "{camera}the lattice has drifted by ({x:.3}, {y:.3}) px against the camera; the fit allows for it; run lf-calib refine, \
         or write the camera with --camera-out"
    )
}

/// Says what was found of each camera.
fn report_cameras(found: &Together, inputs: &[Input], session: &mut Session) {
    let first = found.cameras.first().map_or(0, |camera| camera.particles);
    let mut lines = Vec::new();
    for (n, (camera, input)) in found.cameras.iter().zip(inputs).enumerate() {
        let CameraFit { shape, shape_std_px: [size, dx, dy], noise, light, pose, particles, shared } = camera;
        let Noise { gain, read_variance } = noise;
        lines.push(json!({"camera": input.camera_name, "size_px": shape.sigma_px, "drift_px": shape.drift_px,
            "size_std_px": size, "drift_std_px": [dx, dy], "gain_counts": gain,
            "read_noise_counts": read_variance.sqrt(), "light": light, "particles_alone": particles}));
        if n == 0 {
            continue;
        }
        lines[n]["shared"] = json!(shared);
        lines[n]["pose"] = json!(pose);
        let [x, y] = shape.drift_px;
        if x.hypot(y) > DRIFT_PX {
            session.warn(drifted(&format!("{}: ", input.camera_name), [x, y]));
        }
        if (*shared as f64) < SHARED * first.min(*particles) as f64 {
            session.warn(format!(
                "{}: finds {particles} particles alone, and {shared} of them where a camera before it finds one: its pose \
                 may be wrong",
                input.camera_name
            ));
        }
    }
    if !lines.is_empty() {
        session.count("cameras", Value::Array(lines));
    }
}

/// Drift that spoils a reconstruction, px: 0.2 px leave ghosts, and vectors in depth twice as wrong.
const DRIFT_PX: f64 = 0.1;

/// Cameras that see the same particles share more of them than this part of the shorter list.
const SHARED: f64 = 0.3;

/// Length of a drawn particle along z over its width: that of the truth of lf-synth.
const LENGTH: f64 = 10.0;
/// Least standard deviation of a drawn particle, voxels: a smaller one falls between them.
const LEAST_DRAWN: f64 = 0.3;

fn write(arguments: &Arguments, inputs: &[Input], found: &Together, log: &str, session: &mut Session) -> Result<()> {
    let (Input { camera, volume, .. }, cameras, found) = (&inputs[0], &found.cameras, &found.fit);
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
    for (n, file) in arguments.camera_out.iter().enumerate() {
        let shape = cameras.get(n).map_or(&found.shape, |found| &found.shape);
        let mut moved = shape.camera(&inputs[n].camera);
        if n > 0 {
            moved.pose = Some(posed(camera, &cameras[n].pose));
        }
        io::save_text(file, |out| writeln!(out, "{}", moved.to_json()))?;
    }
    match &arguments.log {
        Some(file) => io::save_text(file, |out| out.write_all(log.as_bytes())),
        None => Ok(()),
    }
}

/// The pose of a camera to which `from_first` leads from the frame of the first.
fn posed(first: &Camera, from_first: &Pose) -> Pose {
    let first = first.pose.unwrap_or_default();
    let rows = (from_first.matrix() * first.matrix()).transpose();
    let rotation = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.to_array());
    Pose { rotation, translation_mm: from_first.to_camera(first.translation_mm) }
}

fn particle(frame: usize, id: usize, found: &Found) -> Particle {
    let [xx, xy, xz, yy, yz, zz] = found.covariance_mm2;
    let covariance_mm2 = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    let uncertainty = Some(Uncertainty { covariance_mm2, intensity: found.light_std });
    Particle { frame, id: id as u64, place_mm: found.spot.place_mm, intensity: found.spot.light, uncertainty }
}
