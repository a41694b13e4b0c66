//! Reads images, cameras and volumes, fits, and writes particles, volume, cameras and log.

use super::arguments::Arguments;
use super::inputs;
use glam::DMat3;
use lf_core::camera::{Correction, EXPLAINED, Evidence, Pose};
use lf_core::particles::{self, Uncertainty};
use lf_core::{Camera, Error, Result, Session, Verdict, cli, image, io, volume};
use lf_fit::{
    self as fit, CameraInput, CameraView, Changes, Defects, Doubts, Fit, FitOptions, FoundParticle, Particle, PiledUp,
    Progress, RANDOM,
};
use serde_json::{Map, Value, json};
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
    let files = inputs::open(arguments, session)?;
    inputs::check(&files, arguments, &outputs(arguments), session)?;
    let (inputs, first_bytes) = inputs::start(files, arguments, session)?;
    let volume_name = |n: usize| io::name(&arguments.volume[n]);
    let bytes =
        fit::estimated_bytes(&inputs, &options, first_bytes).map_err(|(n, refusal)| refusal.about(volume_name(n)))?;
    let voxels: usize = inputs.iter().map(|input| input.volume.count()).sum();
    if arguments.estimate {
        session.print_estimate(bytes, &[("voxels", voxels as u64)], &[])?;
        return Ok(Verdict::Done);
    }
    session.allow_memory(arguments.memory, bytes as f64, volume_name(0), || format!("a fit to {voxels} voxels"))?;
    for input in &inputs {
        session.warn_of_frame(&input.image, &input.camera, !arguments.background.is_empty());
        session.explain(format!("camera: {}", input.camera.about()));
    }
    let (found, log) = solve(arguments, &inputs, &options, session)?;
    report(arguments, &found, session);
    session.phase("write", |session| write(arguments, &inputs[0], &found, &log, session))?;
    Ok(Verdict::Done)
}

/// The files to write.
fn outputs(arguments: &Arguments) -> Vec<&Path> {
    let optional =
        [&arguments.output, &arguments.evidence, &arguments.log].into_iter().flatten().chain(&arguments.camera_out);
    let optional = optional.chain(&arguments.expected);
    std::iter::once(&arguments.particles).chain(optional).map(|path| path.as_path()).collect()
}

/// Refuses outputs that overwrite inputs or each other, or that cannot be written.
fn check_files(arguments: &Arguments, session: &Session) -> Result<()> {
    let Arguments { volume, image, camera, background, mask, start, start_field, .. } = arguments;
    let inputs: Vec<&Path> =
        [volume, image, camera, background, mask].into_iter().flatten().map(|path| path.as_path()).collect();
    let inputs: Vec<&Path> = inputs.into_iter().chain(start.as_deref()).chain(start_field.as_deref()).collect();
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

/// Fits. Returns the particles with their cameras, and the log of the steps.
fn solve<'a>(
    arguments: &Arguments,
    inputs: &'a [CameraInput],
    options: &FitOptions,
    session: &mut Session,
) -> Result<(Fit<'a>, String)> {
    let mut log = String::new();
    let found = session.phase("fit", |session| {
        let began = Instant::now();
        let on_step = |step: &Progress| {
            let (text, mut line) = words(step, began.elapsed().as_secs_f64());
            let name = step.camera.map(|n| io::name(&arguments.camera[n]));
            session.explain_step(name.as_ref().map_or(String::new(), |name| format!("{name}: ")) + &text);
            if let Some(name) = name {
                line["camera"] = json!(name);
            }
            log += &line.to_string();
            log.push('\n');
        };
        let files = if inputs.len() == 1 { &arguments.volume } else { &arguments.camera };
        fit::fit(inputs, options, on_step).map_err(|(n, refusal)| refusal.about(io::name(&files[n])))
    })?;
    Ok((found, log))
}

/// A step in words, and as a line of the log.
fn words(step: &Progress, seconds: f64) -> (String, Value) {
    let Progress { what, particles, changes: Changes { dropped, split, added, gain }, misfit, shape, noise, .. } =
        *step;
    let [x, y] = shape.drift_px;
    let read = noise.read_variance.sqrt();
    let text = format!(
        "{what}: {particles} particles, {dropped} dropped, {split} split, {added} added or moved; chi2 {misfit:.3}, size \
         {:.4} px, drift ({x:.4}, {y:.4}) px, gain {:.3}, read noise {read:.3} counts; {seconds:.1} s",
        shape.sigma_px, noise.gain
    );
    let mut line = json!({"step": what, "particles": particles, "dropped": dropped, "split": split, "added": added,
        "gain_2logl": gain, "chi2": misfit, "size_px": shape.sigma_px, "drift_px": shape.drift_px,
        "gain_counts": noise.gain, "read_noise_counts": read, "seconds": seconds});
    if let Some(blur_px) = shape.blur_px {
        line["blur_px"] = json!(blur_px);
    }
    (text, line)
}

/// Shape and noise of a camera, under the names of the statistics. JSON has no infinity: null says that nothing is
/// known.
fn statistics(view: &CameraView) -> Value {
    let [size_std, x_std, y_std, blur_std, ..] = view.shape_std_px;
    let Defects { pixels, columns, rows } = &view.defects;
    let mut found = json!({"defects": {"pixels": pixels, "columns": columns, "rows": rows},
        "size_px": view.shape.sigma_px, "drift_px": view.shape.drift_px, "size_std_px": size_std,
        "drift_std_px": [x_std, y_std], "gain_counts": view.noise.gain,
        "read_noise_counts": view.noise.read_variance.sqrt()});
    if let Some(blur_px) = view.shape.blur_px {
        (found["blur_px"], found["blur_std_px"]) = (json!(blur_px), json!(blur_std));
    }
    let corrections = view.shape.corrections(view.camera, view.shape_std_px);
    corrections.iter().for_each(|Correction { parameter, step, std }| found[parameter.key] = json!([step, std]));
    found
}

/// Warns of what a camera alone had against its model or its first particles. `name` is that of one of several cameras.
fn warn_of_doubts(doubts: Doubts, view: &CameraView, name: &str, session: &mut Session) {
    let Doubts { misfit_sharp, misfit_far, missing } = doubts;
    if let Some(missing) = missing {
        session.warn(format!(
            "{name}the particles of --start are not those of this image: {missing} others were beside them; the fit began \
             anew without them; check that they are of the frame before, and --start-field"
        ));
    }
    if let (Some(before), Some(sigma_px)) = (misfit_sharp, view.shape.blur_px) {
        session.warn(format!(
            "{name}the image is blurred and camera.json does not say so: chi2 was {before:.2}; fitted with diffraction of \
             green light and a blur of {sigma_px:.2} px; give camera.json a block 'blur' with wavelength_nm and sigma_px \
             (lf-calib nominal --wavelength)"
        ));
    }
    if let Some(before) = misfit_far {
        session.warn(format!(
            "{name}lenslets show Fresnel's pattern and camera.json does not say so: chi2 was {before:.2} with the far field; \
             the fit follows it; write the camera with --camera-out, and begin again with it"
        ));
    }
}

/// Says which defects of a sensor were left out. `name` is that of one of several cameras.
fn say_defects(defects: &Defects, name: &str, session: &Session) {
    let Defects { pixels, columns, rows } = defects;
    let lines = |kind: &str, lines: &[usize]| (!lines.is_empty()).then(|| format!("{kind} {lines:?}"));
    let single = (*pixels > 0).then(|| format!("{pixels} pixels"));
    let found: Vec<String> = [single, lines("columns", columns), lines("rows", rows)].into_iter().flatten().collect();
    if !found.is_empty() {
        session.say(format!(
            "{name}{} are hot or dead: they differ from the light of particles and those around them do not; the fit leaves \
             them out",
            found.join(", ")
        ));
    }
}

/// Warns of a model that does not explain the image.
fn warn_of_model(found: &Fit, session: &mut Session) {
    let Fit { misfit, residual, excess, widened, is_stopped, .. } = *found;
    let CameraView { shape, camera, shape_std_px, flat, .. } = found.cameras[0];
    let corrected = shape.corrections(camera, shape_std_px);
    let bounds = shape.at_bounds();
    bounds.iter().for_each(|(name, end)| {
        session.warn(format!(
            "the {name} of the particles' images ran to its bound of {end} px and was held there: the camera or the \
             background is wrong, or these are not particles"
        ));
    });
    if !corrected.is_empty() {
        let each: Vec<String> = corrected.iter().map(|one| format!("the {}", one.words())).collect();
        // Light that falls towards the rim of the stop looks like a smaller one.
        let is_shaded = flat.is_none() && corrected.iter().any(|one| one.parameter.key.starts_with("f_number"));
        let shading = "light that falls towards the rim of the stop looks the same: give the camera a flat field (lf-calib \
                       lattice --vignetting)";
        let doubts =
            is_shaded.then(|| shading.to_owned()).into_iter().chain(corrected.iter().filter_map(Correction::doubt));
        let doubts: String = doubts.map(|doubt| format!("; {doubt}")).collect();
        session.warn(format!(
            "the camera does not explain the image: {}; the fit corrects it; write the camera with --camera-out, and begin \
             again with it{doubts}; --hold camera keeps what is given",
            each.join(", ")
        ));
    }
    for PiledUp { end_mm, count, usual } in found.piled_up() {
        let digits = if end_mm.abs() < 1.0 { 2 } else { 1 };
        session.warn(format!(
            "{count} particles lie at the end of the depths, {end_mm:.digits$} mm, where {usual:.0} are usual: particles beyond \
             it are pressed into it; give lf-prune a larger --depth. Haze, which is smooth from lenslet to lenslet, looks the \
             same: subtract it (lf-calib background --haze)"
        ));
    }
    if excess > 1.0 {
        let how_far = match misfit > EXPLAINED {
            true => format!("chi2 is {misfit:.2}, up to {EXPLAINED} is good"),
            false => format!(
                "differences of neighbouring pixels correlate by {:.2}, those of noise by less than {RANDOM}",
                residual.beside
            ),
        };
        let stopped = if is_stopped { "; more particles did not help, so none were added" } else { "" };
        session.warn(format!(
            "noise does not explain the image: {how_far}{stopped}; uncertainties are {:.2} times as large for it; check \
             the camera (lf-calib lattice, refine), its blur and the background, which may be haze (lf-calib background \
             --haze)",
            excess.sqrt()
        ));
    }
    if widened.into_iter().any(|factor| factor > WIDENED) {
        let [x, y, z] = widened;
        session.warn(format!(
            "the model does not explain the particles' images: their parts disagree on x, y and z by {x:.2}, {y:.2} and {z:.2} \
             times what noise explains; uncertainties are as much larger; check the camera (lf-calib lattice, volume, \
             refine) and its blur"
        ));
    }
}

/// Parts of the images that disagree by more than this, over noise, show a wrong model.
const WIDENED: f64 = 1.25;

/// Counts and warns of what was found.
fn report(arguments: &Arguments, found: &Fit, session: &mut Session) {
    for ((doubts, view), file) in found.doubts.iter().zip(&found.cameras).zip(&arguments.camera) {
        let name = if found.cameras.len() > 1 { format!("{}: ", io::name(file)) } else { String::new() };
        warn_of_doubts(*doubts, view, &name, session);
        say_defects(&view.defects, &name, session);
    }
    warn_of_model(found, session);
    session.count("particles", found.particles.len());
    session.count("untold", found.untold);
    session.count("size_spread", found.size_spread);
    session.count("chi2", found.misfit);
    session.count("widened", found.widened);
    session.count("residual_correlation", found.residual.beside);
    for (name, value) in statistics(&found.cameras[0]).as_object().into_iter().flatten() {
        session.count(name, value.clone());
    }
    let mut lines = Vec::new();
    for (n, view) in found.cameras.iter().enumerate() {
        let (name, mut line) = (io::name(&arguments.camera[n]), statistics(view));
        let CameraView { shape, light, pose, pose_std, particles_alone, shared, .. } = view;
        line["camera"] = json!(name);
        line["light"] = json!(light);
        line["particles_alone"] = json!(particles_alone);
        let [x, y] = shape.drift_px;
        if x.hypot(y) > DRIFT_PX {
            let camera = if n == 0 { String::new() } else { format!("{name}: ") };
            session.warn(format!(
                "{camera}the lattice has drifted by ({x:.3}, {y:.3}) px against the camera; the fit allows for it; write \
                 the camera with --camera-out, or by lf-calib refine from the --evidence of several frames"
            ));
        }
        if n > 0 {
            line["shared"] = json!(shared);
            line["pose"] = json!(pose);
            if let Some((turn_rad, shift_mm)) = pose_std {
                line["pose_std"] = json!({"turn_rad": turn_rad, "shift_mm": shift_mm});
            }
            if (*shared as f64) < SHARED * found.cameras[0].particles_alone.min(*particles_alone) as f64 {
                session.warn(format!(
                    "{name}: finds {particles_alone} particles alone, and {shared} of them where a camera before it finds \
                     one: its pose may be wrong"
                ));
            }
        }
        lines.push(line);
    }
    if lines.len() > 1 {
        session.count("cameras", Value::Array(lines));
    }
}

/// Drift that spoils a reconstruction, px: 0.2 px leave ghosts, and vectors in depth twice as wrong.
const DRIFT_PX: f64 = 0.1;

/// Cameras that see the same particles share more of them than this part of the shorter list.
const SHARED: f64 = 0.3;

/// Length of a drawn particle along z over its width: that of the truth of lf-synth.
const LENGTH: f64 = 10.0;
/// Smallest standard deviation of a drawn particle, voxels: a smaller one falls between them.
const LEAST_DRAWN: f64 = 0.3;

fn write(arguments: &Arguments, first: &CameraInput, found: &Fit, log: &str, session: &mut Session) -> Result<()> {
    let CameraInput { camera, volume, .. } = first;
    let history = session.history(volume.history());
    if let Some(file) = &arguments.evidence {
        let none =
            || Error::new(io::name(&arguments.image[0]), "no particle says anything of the camera", "wanted particles");
        let evidence = Evidence { frame: arguments.frame, ..found.evidence.clone().ok_or_else(none)? };
        io::save_text(file, |out| writeln!(out, "{}", json!(evidence)))?;
    }
    if let Some(file) = &arguments.output {
        let grid = volume.grid();
        let sigma_mm = found.cameras[0].shape.sigma_px * camera.pixel_in_focus_mm();
        let [dx, dy, dz] = grid.spacing_mm;
        let sizes = [sigma_mm / dx, sigma_mm / dy, LENGTH * sigma_mm / dz].map(|size| size.max(LEAST_DRAWN));
        let place_and_light = |n: usize| (found.particles[n].particle.place_mm, found.particles[n].particle.light);
        let (indices, intensity) = particles::draw(grid, sizes, found.particles.len(), place_and_light);
        io::save(file, |out| {
            let column = ("intensity", intensity.as_slice());
            volume::write_with(out, grid, &indices, &[column], &history, volume.extra())
        })?;
    }
    let CameraView { shape, shape_std_px, .. } = found.cameras[0];
    let px = |one: &Correction| [one.step, one.std].map(|value| value / one.parameter.per_px(camera));
    let corrections: Map<String, Value> = shape
        .corrections(camera, shape_std_px)
        .iter()
        .map(|one| (one.parameter.key.to_owned(), json!(px(one))))
        .collect();
    let corrected =
        (!corrections.is_empty()).then(|| format!("{} {}", particles::CORRECTED, Value::Object(corrections)));
    let comments: Vec<String> = history.iter().map(|step| json!(step).to_string()).chain(corrected).collect();
    let rows = found.particles.iter().enumerate().map(|(id, found)| row(arguments.frame, id, found));
    let table: Vec<particles::Particle> = rows.collect();
    io::save_text(&arguments.particles, |out| particles::write(out, &comments, &table))?;
    for (n, (file, view)) in arguments.camera_out.iter().zip(&found.cameras).enumerate() {
        let mut moved = view.shape.camera(view.camera);
        if n > 0 {
            moved.pose = Some(posed(camera, &view.pose));
        }
        io::save_text(file, |out| writeln!(out, "{}", moved.to_json()))?;
    }
    for (file, view) in arguments.expected.iter().zip(&found.cameras) {
        image::save(file, &view.expected(), &history)?;
    }
    match &arguments.log {
        Some(file) => io::save_text(file, |out| out.write_all(log.as_bytes())),
        None => Ok(()),
    }
}

/// The pose of a camera in the common frame, from its pose in the frame of the first.
fn posed(first: &Camera, from_first: &Pose) -> Pose {
    let first = first.pose.unwrap_or_default();
    let rows = (from_first.matrix() * first.matrix()).transpose();
    let rotation = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.to_array());
    Pose { rotation, translation_mm: from_first.to_camera(first.translation_mm) }
}

/// A row of the table of particles.
fn row(frame: usize, id: usize, found: &FoundParticle) -> particles::Particle {
    let [xx, xy, xz, yy, yz, zz] = found.covariance_mm2;
    let covariance_mm2 = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    let uncertainty = Some(Uncertainty { covariance_mm2, intensity: found.light_std });
    let Particle { place_mm, light, .. } = found.particle;
    particles::Particle { frame, id: id as u64, place_mm, intensity: light, uncertainty }
}
