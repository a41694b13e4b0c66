//! Frames, particles and truth.

use super::{Stage, report, save_image, save_text};
use crate::{Format, Source};
use lf_core::cli::Session;
use lf_core::flow::Velocity;
use lf_core::grid::Grid;
use lf_core::{Error, Result, io, volume};
use lf_synth::cast::Cast;
use lf_synth::particles::{self, Particle, Spread};
use lf_synth::{noise, truth};
use std::path::Path;
use std::time::Instant;

/// The velocity field of a scene's flow.
fn velocity(stage: &Stage, name: &str) -> Result<Velocity> {
    let Some(flow) = &stage.scene.flow else { return Ok(Velocity::rest()) };
    let camera = &stage.camera;
    let pixel_mm = camera.pixel_in_focus_mm();
    flow.open(stage.scene.bounds_mm(), pixel_mm, name)
}

/// The particles of every frame of tracks.
fn tracks(file: &Path, times: &[f64]) -> Result<Cast> {
    let wrong = |found| Error::new(io::name(file), found, "wanted a particles.csv of every frame");
    let frames = particles::tracks_from_csv(&io::open_text(file)?).map_err(wrong)?;
    if let Some(time) = times.iter().find(|t| t.fract() != 0.0 || **t < 0.0 || **t >= frames.len() as f64) {
        return Err(wrong(format!("has {} frames, none of them at the scene's time {time}", frames.len())));
    }
    Ok(Cast::Given(times.iter().map(|time| frames[*time as usize].clone()).collect()))
}

/// The particles of the first frame, or of a density.
fn seeded(stage: &Stage, name: &str, velocity: &Velocity, session: &Session) -> Result<Vec<Particle>> {
    let (scene, p) = (&stage.scene, &stage.scene.particles);
    let bounds = scene.bounds_mm();
    let Some(csv) = &p.csv else {
        let spread = Spread {
            intensity: p.intensity,
            intensity_spread: p.intensity_spread.unwrap_or(0.0),
            size_spread: p.size_spread.unwrap_or(0.0),
        };
        let (count, times) = (scene.particle_count(&stage.camera), scene.frames.times());
        return particles::seed_evenly(count, bounds, velocity, &times, &spread, scene.seed)
            .map_err(|found| Error::new(name, found, "wanted fewer particles, or less motion"));
    };
    let text = io::open_text(csv)?;
    let all = particles::from_csv(&text).map_err(|found| Error::new(io::name(csv), found, "wanted a particles.csv"))?;
    let outside = all.len() - particles::inside(&all, bounds).len();
    if outside > 0 {
        session.warn(format!("{}: {outside} of {} particles are outside the volume", io::name(csv), all.len()));
    }
    Ok(all)
}

/// Bytes that the particles, a frame and its truth take at their most.
fn bytes(stage: &Stage, cast: &Cast, grid: Option<&Grid>) -> f64 {
    let sensor = &stage.camera.sensor;
    let voxels = stage.scene.truth.as_ref().zip(grid).map_or(0.0, |(truth, grid)| {
        let of_particle = (8.0 * truth.sigma_vox + 1.0).powi(3);
        (cast.most() as f64 * of_particle).min(grid.shape.iter().map(|n| *n as f64).product())
    });
    let particles = cast.most() as f64 * size_of::<Particle>() as f64;
    12.0 * (sensor.width * sensor.height) as f64 + 3.0 * particles + 24.0 * voxels
}

pub fn render(
    source: &Source,
    folder: &Path,
    format: Format,
    measure_noise: bool,
    most_bytes: f64,
    session: &mut Session,
) -> Result<()> {
    if most_bytes.is_nan() || most_bytes <= 0.0 {
        return Err(Error::new("--max-memory", format!("{}", 1e-9 * most_bytes), "wanted a number of GB above 0"));
    }
    super::check_folder(folder)?;
    let stage = Stage::open(source, session)?;
    let (scene, camera) = (&stage.scene, &stage.camera);
    let unseen = scene.unseen_share(camera);
    if unseen > 1e-9 {
        session.warn(format!("{:.1} % of the volume's section lies beside what the sensor sees", 100.0 * unseen));
    }
    let name = io::name(&source.scene);
    let grid = scene.grid(camera).map_err(|found| Error::new(&name, found, "wanted a scene.json"))?;
    let times = scene.frames.times();
    let numbered = |n| [format!("frame-{n:04}.{}", format.extension()), format!("truth-{n:04}.lfv")];
    let mut files: Vec<String> = (0..times.len()).flat_map(numbered).collect();
    files.extend(["flow.exr", "particles.csv", "camera.json", "scene-used.json"].map(String::from));
    for file in &files {
        stage.keep_apart(&folder.join(file), session)?;
    }
    let mut cast = match scene.flow.as_ref().and_then(|flow| flow.tracks()) {
        Some(file) => tracks(file, &times)?,
        None => {
            let velocity = velocity(&stage, &name)?;
            Cast::Carried { all: seeded(&stage, &name, &velocity, session)?, velocity, time: 0.0 }
        }
    };
    let bytes = bytes(&stage, &cast, grid.as_ref());
    session.count("estimated_bytes", bytes as u64);
    session.explain(format!(
        "about {:.2} GB of memory, of {} GB allowed, for {} frames of {} particles each at most",
        1e-9 * bytes,
        1e-9 * most_bytes,
        times.len(),
        cast.most()
    ));
    if bytes > most_bytes {
        let found = format!("needs about {:.1} GB", 1e-9 * bytes);
        return Err(Error::new(name, found, format!("wanted --max-memory {:.1} to allow it", 1e-9 * most_bytes)));
    }
    std::fs::create_dir_all(folder).map_err(|error| io::writing(&io::output_name(folder), &error))?;
    let (instrument, glow) = (stage.instrument(), scene.glow(camera));
    let history = session.history(&Vec::new());
    let (mut counts, mut rays, mut shown) = (Vec::new(), 0, Vec::new());
    for (frame, &time) in times.iter().enumerate() {
        let lit = session.phase("carry", |_| Ok(cast.at(frame, time, scene.bounds_mm(), scene.light.as_ref())))?;
        let seed = scene.seed ^ ((frame as u64) << 32);
        let mut image = session.phase("render", |session| {
            let progress = session.progress("particles", lit.len() as u64);
            let started = Instant::now();
            let image = instrument.frame(&lit, &glow, seed, |n| progress.add(n));
            let what = format!("frame {frame}: {} particles", lit.len());
            report(&what, &image, started.elapsed().as_secs_f64(), session);
            Ok(image)
        })?;
        rays += image.rays;
        stage.record(&mut image.pixels, frame, session)?;
        let [frame_file, truth_file] = numbered(frame);
        save_image(&folder.join(frame_file), &image.pixels, session)?;
        drop(image);
        if measure_noise && frame == 0 {
            let noise = session.phase("measure noise", |_| Ok(noise::measure(&instrument, &lit, &glow, seed)))?;
            session.say(format!(
                "ray noise {:.2} % of the brightest pixel, by {} particles",
                100.0 * noise,
                noise::SAMPLE
            ));
            session.count("ray_noise", noise);
        }
        if let (Some(truth), Some(grid)) = (&scene.truth, &grid) {
            let (indices, intensity) = session.phase("truth", |_| Ok(truth::volume(grid, &lit, truth.sigma_vox)))?;
            session.phase("write", |_| {
                let columns = [("intensity", &intensity[..])];
                io::save(&folder.join(truth_file), |out| volume::write(out, grid, &indices, &columns, &history))
            })?;
        }
        counts.push(lit.len());
        shown.push(lit);
    }
    session.phase("write", |_| {
        if let (Some(truth), Some(grid), Cast::Carried { velocity, .. }) = (&scene.truth, &grid, &cast) {
            let interval = scene.frames.interval();
            let spacing = grid.spacing_mm;
            let (bounds, shape) = (scene.bounds_mm(), truth.vectors);
            let flow = truth::displacement(velocity, interval, bounds, shape, spacing, history.clone());
            flow.save(&folder.join("flow.exr"))?;
        }
        save_text(&folder.join("particles.csv"), &particles::to_csv(&shown))?;
        save_text(&folder.join("camera.json"), &camera.to_json())?;
        save_text(&folder.join("scene-used.json"), &stage.used())
    })?;
    session.count("frames", times.len());
    session.count("particles", counts.first().copied().unwrap_or(0));
    session.count("rays", rays);
    Ok(())
}
