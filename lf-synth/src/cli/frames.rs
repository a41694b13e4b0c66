//! `frames`: frames, particles and truth.

use super::images::{check_folder, create_folder, rendered, save_image, save_text};
use super::{arguments::FramesArguments, setup::Setup};
use lf_core::{Error, Grid, History, Refusal, Result, Session, flow::Velocity, io, volume};
use lf_synth::particles::{Appearance, Particle, Tracers, inside, seed_evenly, table};
use lf_synth::rays::{self, Glow, Instrument, Rendered, ray_noise};
use lf_synth::truth;
use std::path::Path;

/// Renders the frames of a scene into a folder.
pub fn render(arguments: &FramesArguments, session: &mut Session) -> Result<()> {
    let FramesArguments { source, output: folder, format, measure_noise, max_memory } = arguments;
    if max_memory.is_nan() || *max_memory <= 0.0 {
        return Err(Error::new("--max-memory", max_memory.to_string(), "wanted a number of GB above 0"));
    }
    check_folder(folder)?;
    let setup = Setup::open(source, session)?;
    let scene = &setup.scene;
    warn_of_unseen(&setup, session);
    let name = io::name(&source.scene);
    let grid = scene.grid(&setup.camera).map_err(|refusal| refusal.about(&name))?;
    let times = scene.frames.times();
    let file_of_frame = |n| format!("frame-{n:04}.{}", format.extension());
    let files = (0..times.len()).flat_map(|n| [file_of_frame(n), file_of_truth(n)]);
    for file in files.chain(["flow.exr", "particles.csv", "camera.json", "scene-used.json"].map(String::from)) {
        setup.keep_apart(&folder.join(file), session)?;
    }
    let mut tracers = tracers(&setup, &name, &times, session)?;
    check_memory(&setup, &tracers, grid.as_ref(), *max_memory, session).map_err(|refusal| refusal.about(&name))?;
    create_folder(folder)?;
    let (instrument, glow) = (setup.instrument(), scene.glow(&setup.camera));
    let history = session.history(&Vec::new());
    let (mut rays, mut shown) = (0, Vec::new());
    for (frame, &time) in times.iter().enumerate() {
        let lit = session.phase("carry", |_| Ok(tracers.lit(frame, time, scene.bounds_mm(), scene.light.as_ref())))?;
        let seed = scene.seed ^ ((frame as u64) << 32);
        let mut image = render_frame(frame, &instrument, &lit, &glow, seed, session)?;
        rays += image.rays;
        setup.record(&mut image.pixels, frame, session)?;
        save_image(&folder.join(file_of_frame(frame)), &image.pixels, session)?;
        drop(image);
        if *measure_noise && frame == 0 {
            tell_noise(&instrument, &lit, &glow, seed, session)?;
        }
        if let Some(grid) = &grid {
            save_truth(&setup, grid, &lit, &folder.join(file_of_truth(frame)), &history, session)?;
        }
        shown.push(lit);
    }
    session.phase("write", |_| {
        if let (Some(grid), Tracers::Carried { velocity, .. }) = (&grid, &tracers) {
            save_displacement(&setup, grid, velocity, &folder.join("flow.exr"), history)?;
        }
        save_text(&folder.join("particles.csv"), &table::to_csv(&shown))?;
        save_text(&folder.join("camera.json"), &setup.camera.to_json())?;
        save_text(&folder.join("scene-used.json"), &setup.used())
    })?;
    session.count("frames", times.len());
    session.count("particles", shown.first().map_or(0, Vec::len));
    session.count("rays", rays);
    Ok(())
}

fn file_of_truth(frame: usize) -> String {
    format!("truth-{frame:04}.lfv")
}

/// Warns if the sensor does not see all of the volume.
fn warn_of_unseen(setup: &Setup, session: &Session) {
    let unseen = setup.scene.unseen_share(&setup.camera);
    if unseen > 1e-9 {
        session.warn(format!("{:.1} % of the volume's section lies outside the sensor's view", 100.0 * unseen));
    }
}

/// The particles of the frames: from a table of tracks, or carried by the flow.
fn tracers(setup: &Setup, name: &str, times: &[f64], session: &Session) -> Result<Tracers> {
    let Some(flow) = &setup.scene.flow else {
        return carried(setup, name, Velocity::rest(), session);
    };
    match flow.tracks() {
        Some(file) => tracks(file, times),
        None => {
            let velocity = flow.open(setup.scene.bounds_mm(), setup.camera.pixel_in_focus_mm(), name)?;
            carried(setup, name, velocity, session)
        }
    }
}

/// The particles of every frame, from a table of tracks.
fn tracks(file: &Path, times: &[f64]) -> Result<Tracers> {
    let wrong = |refusal: Refusal| refusal.about(io::name(file));
    let frames = table::tracks(&io::open_text(file)?).map_err(wrong)?;
    if let Some(time) = times.iter().find(|t| t.fract() != 0.0 || **t < 0.0 || **t >= frames.len() as f64) {
        let found = format!("has {} frames, none of them at the scene's time {time}", frames.len());
        return Err(wrong(Refusal::new(found, table::TRACKS_WANTED)));
    }
    Ok(Tracers::Given(times.iter().map(|time| frames[*time as usize].clone()).collect()))
}

/// The particles of the first frame, from a table or seeded, with the flow that carries them.
fn carried(setup: &Setup, name: &str, velocity: Velocity, session: &Session) -> Result<Tracers> {
    let (scene, p) = (&setup.scene, &setup.scene.particles);
    let bounds = scene.bounds_mm();
    let all = match &p.csv {
        Some(csv) => {
            let all = table::first_frame(&io::open_text(csv)?).map_err(|refusal| refusal.about(io::name(csv)))?;
            let outside = all.len() - inside(&all, bounds).len();
            if outside > 0 {
                let count = all.len();
                session.warn(format!("{}: {outside} of {count} particles are outside the volume", io::name(csv)));
            }
            all
        }
        None => {
            let appearance = Appearance {
                intensity: p.intensity,
                intensity_spread: p.intensity_spread.unwrap_or(0.0),
                size_spread: p.size_spread.unwrap_or(0.0),
            };
            let count = scene.particle_count(&setup.camera);
            seed_evenly(count, bounds, &velocity, &scene.frames.times(), &appearance, scene.seed)
                .map_err(|refusal| refusal.about(name))?
        }
    };
    Ok(Tracers::Carried { all, velocity, time: 0.0 })
}

/// Upper estimate of the memory of the particles, a frame and its truth, bytes.
fn estimated_bytes(setup: &Setup, tracers: &Tracers, grid: Option<&Grid>) -> f64 {
    let sensor = &setup.camera.sensor;
    let voxels = setup.scene.truth.as_ref().zip(grid).map_or(0.0, |(truth, grid)| {
        let voxels_per_particle = (8.0 * truth.sigma_vox + 1.0).powi(3);
        (tracers.most() as f64 * voxels_per_particle).min(grid.shape.iter().map(|n| *n as f64).product())
    });
    let particles = tracers.most() as f64 * size_of::<Particle>() as f64;
    12.0 * (sensor.width * sensor.height) as f64 + 3.0 * particles + 24.0 * voxels
}

/// Says how much memory the run takes, and refuses it above `max_memory` GB.
fn check_memory(
    setup: &Setup,
    tracers: &Tracers,
    grid: Option<&Grid>,
    max_memory: f64,
    session: &mut Session,
) -> std::result::Result<(), Refusal> {
    let bytes = estimated_bytes(setup, tracers, grid);
    session.count("estimated_bytes", bytes as u64);
    session.explain(format!(
        "about {:.2} GB of memory, of {max_memory} GB allowed, for {} frames of at most {} particles each",
        1e-9 * bytes,
        setup.scene.frames.times().len(),
        tracers.most()
    ));
    if bytes > 1e9 * max_memory {
        let found = format!("needs about {:.1} GB", 1e-9 * bytes);
        return Err(Refusal::new(found, format!("wanted --max-memory {max_memory:.1} to allow it")));
    }
    Ok(())
}

fn render_frame(
    frame: usize,
    instrument: &Instrument,
    lit: &[Particle],
    glow: &Glow,
    seed: u64,
    session: &mut Session,
) -> Result<Rendered> {
    let what = format!("frame {frame}: {} particles", lit.len());
    rendered(&what, ("particles", lit.len() as u64), session, |done| rays::frame(instrument, lit, glow, seed, done))
}

/// Measures the noise of the ray tracing and says it.
fn tell_noise(instrument: &Instrument, lit: &[Particle], glow: &Glow, seed: u64, session: &mut Session) -> Result<()> {
    let noise = session.phase("measure noise", |_| Ok(ray_noise::measure(instrument, lit, glow, seed)))?;
    let percent = 100.0 * noise;
    session.say(format!("ray noise {percent:.2} % of the brightest pixel, by {} particles", ray_noise::SAMPLE));
    session.count("ray_noise", noise);
    Ok(())
}

/// Writes the exact volume of a frame, if the scene has a truth.
fn save_truth(
    setup: &Setup,
    grid: &Grid,
    lit: &[Particle],
    file: &Path,
    history: &History,
    session: &mut Session,
) -> Result<()> {
    let Some(truth) = &setup.scene.truth else { return Ok(()) };
    let (indices, intensity) = session.phase("truth", |_| Ok(truth::volume(grid, lit, truth.sigma_vox)))?;
    session.phase("write", |_| {
        let columns = [("intensity", &intensity[..])];
        io::save(file, |out| volume::write(out, grid, &indices, &columns, history))
    })
}

/// Writes the exact displacement from the first frame to the second, if the scene has a truth.
fn save_displacement(setup: &Setup, grid: &Grid, velocity: &Velocity, file: &Path, history: History) -> Result<()> {
    let scene = &setup.scene;
    let Some(truth) = &scene.truth else { return Ok(()) };
    let (interval, bounds) = (scene.frames.interval(), scene.bounds_mm());
    truth::displacement(velocity, interval, bounds, truth.vectors, grid.spacing_mm, history).save(file)
}
