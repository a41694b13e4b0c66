//! `frames`: frames, particles and truth.

use super::images::{LAST_FILE, begin_folder, check_folder, rendered, save_image, save_text};
use super::{arguments::FramesArguments, setup::Setup};
use lf_core::flow::{Flows, Velocity};
use lf_core::{Refusal, Result, Session, cli, io, particles, volume};
use lf_synth::particles::{Appearance, Particle, Tracers, inside, seed_evenly, table};
use lf_synth::rays::{self, Glow, Instrument};
use lf_synth::{memory, scene, truth};
use std::path::Path;

/// Renders the frames of a scene into a folder.
pub fn render(arguments: &FramesArguments, session: &mut Session) -> Result<()> {
    let FramesArguments { source, output: folder, format, measure_noise } = arguments;
    check_folder(folder)?;
    let setup = Setup::open(source, session)?;
    let Setup { scene, camera, .. } = &setup;
    let unseen = scene.unseen_share(camera);
    if unseen > 1e-9 {
        session.warn(format!("{:.1} % of the volume's section lies outside the sensor's view", 100.0 * unseen));
    }
    let grid = scene.grid(camera).map_err(|refusal| refusal.about(&setup.name))?;
    let truth = scene.truth.as_ref().zip(grid);
    let times = scene.frames.times();
    let file_of_frame = |n| format!("frame-{n:04}.{}", format.extension());
    let file_of_truth = |n| format!("truth-{n:04}.lfv");
    let files = (0..times.len()).flat_map(|n| [file_of_frame(n), file_of_truth(n)]);
    let names = files.chain(["flow.exr", "particles.csv", "camera.json", LAST_FILE].map(String::from));
    // A table of tracks has no field of displacements.
    let has_flow = truth.is_some() && scene.flow.as_ref().and_then(Flows::tracks).is_none();
    let is_written = |name: &String| match name.as_str() {
        "flow.exr" => has_flow,
        name => truth.is_some() || !name.starts_with("truth-"),
    };
    let names: Vec<String> = names.filter(is_written).collect();
    names.iter().try_for_each(|name| setup.keep_apart(&folder.join(name), session))?;
    let seeded = scene.particle_count(camera) * size_of::<Particle>() as f64;
    let count = || format!("{:.0} particles", scene.particle_count(camera));
    cli::check_memory(source.memory, seeded, &setup.name, count)?;
    let mut tracers = tracers(&setup, &times, session)?;
    let (instrument, glow) = (setup.instrument(), scene.glow(camera));
    let (most, exact) = (tracers.most(), truth.as_ref().map(|(truth, grid)| (*truth, grid)));
    let bytes =
        memory::frames(&instrument, &scene::seen(most, camera), &glow, times.len(), scene.sensor_noise.as_ref(), exact);
    let bytes = if *measure_noise { bytes.max(memory::measured_noise(&instrument)) } else { bytes };
    let frames = || format!("{} frames of at most {} particles each", times.len(), most.len());
    setup.allow_memory(bytes, || format!("{}, {}", setup.sensor(), frames()), session)?;
    begin_folder(folder, &names, session)?;
    let history = session.history(&Vec::new());
    let (mut rays, mut shown) = (0, Vec::new());
    for (frame, &time) in times.iter().enumerate() {
        let lit =
            session.phase("carry", |_| Ok(tracers.lit(frame, time, scene.volume.bounds_mm(), scene.light.as_ref())))?;
        let (seed, seen) = (scene.seed_of(camera) ^ ((frame as u64) << 32), scene::seen(&lit, camera));
        let (about, total) = (format!("frame {frame}: {} particles", lit.len()), lit.len() as u64);
        let mut image =
            rendered(&about, ("particles", total), session, |done| rays::frame(&instrument, &seen, &glow, seed, done))?;
        rays += image.rays;
        setup.record(&format!("frame {frame}"), &mut image.pixels, frame, session)?;
        save_image(&folder.join(file_of_frame(frame)), &image.pixels, session)?;
        drop(image);
        if *measure_noise && frame == 0 {
            report_noise(&instrument, &seen, &glow, seed, session)?;
        }
        if let Some((truth, grid)) = &truth {
            let (indices, intensity) = session.phase("truth", |_| Ok(truth::volume(grid, &lit, truth.sigma_vox)))?;
            session.phase("write", |_| {
                let columns = [("intensity", &intensity[..])];
                let file = folder.join(file_of_truth(frame));
                io::save(&file, |out| volume::write(out, grid, &indices, &columns, &history))
            })?;
        }
        shown.push(lit);
    }
    session.phase("write", |_| {
        if let (Some((truth, grid)), Tracers::Carried { velocity, .. }) = (&truth, &tracers) {
            let (interval, bounds) = (scene.frames.interval(), scene.volume.bounds_mm());
            let flow = truth::displacement(velocity, interval, bounds, truth.vectors, grid.spacing_mm, history);
            flow.save(&folder.join("flow.exr"))?;
        }
        save_text(&folder.join("particles.csv"), &table::to_csv(&shown))?;
        setup.save(folder)
    })?;
    session.count("frames", times.len());
    session.count("particles", shown.first().map_or(0, Vec::len));
    session.count("rays", rays);
    Ok(())
}

/// The particles of the frames: from a table of tracks, or those of the first frame, carried by the flow.
fn tracers(setup: &Setup, times: &[f64], session: &Session) -> Result<Tracers> {
    let (scene, p) = (&setup.scene, &setup.scene.particles);
    if let Some(file) = scene.flow.as_ref().and_then(Flows::tracks) {
        return tracks(file, times, session);
    }
    let bounds = scene.volume.bounds_mm();
    let velocity = match &scene.flow {
        Some(flow) => flow.open(bounds, setup.camera.pixel_in_focus_mm(), &setup.name)?,
        None => Velocity::rest(),
    };
    let all = match &p.csv {
        Some(csv) => {
            let text = io::open_text(csv)?;
            let all = table::first_frame(&text).map_err(|refusal| refusal.about(io::name(csv)))?;
            particles::warn_unmarked(&text, &io::name(csv), session);
            let (count, outside) = (all.len(), all.len() - inside(&all, bounds).len());
            if outside > 0 {
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
            seed_evenly(count, bounds, &velocity, times, &appearance, scene.seed)
                .map_err(|refusal| refusal.about(&setup.name))?
        }
    };
    Ok(Tracers::Carried { all, velocity, time: 0.0 })
}

fn tracks(file: &Path, times: &[f64], session: &Session) -> Result<Tracers> {
    let wrong = |refusal: Refusal| refusal.about(io::name(file));
    let text = io::open_text(file)?;
    let frames = table::tracks(&text).map_err(wrong)?;
    particles::warn_unmarked(&text, &io::name(file), session);
    if let Some(time) = times.iter().find(|t| t.fract() != 0.0 || **t < 0.0 || **t >= frames.len() as f64) {
        let found = format!("has {} frames, none of them at the scene's time {time}", frames.len());
        return Err(wrong(Refusal::new(found, table::TRACKS_WANTED)));
    }
    Ok(Tracers::Given(times.iter().map(|time| frames[*time as usize].clone()).collect()))
}

/// Measures and reports the noise of the ray tracing.
fn report_noise(
    instrument: &Instrument,
    lit: &[Particle],
    glow: &Glow,
    seed: u64,
    session: &mut Session,
) -> Result<()> {
    let noise = session.phase("measure noise", |_| Ok(rays::measure_noise(instrument, lit, glow, seed)))?;
    let percent = 100.0 * noise;
    session.say(format!("ray noise {percent:.2} % of the brightest pixel, by {} particles", rays::NOISE_SAMPLE));
    session.count("ray_noise", noise);
    Ok(())
}
