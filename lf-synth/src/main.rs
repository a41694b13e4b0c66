//! The door of lf-synth: what was typed, scene in, one call, files out.

use clap::{Parser, Subcommand};
use lf_core::camera::Camera;
use lf_core::cli::{self, Common, Session, Verdict};
use lf_core::{Error, Result, image, io, volume};
use lf_synth::flow::Velocity;
use lf_synth::particles::{self, Particle};
use lf_synth::scene::CameraSource;
use lf_synth::{Scene, ready, render, truth};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Particles and a flow to light-field images and the truth, by ray tracing
#[derive(Parser)]
#[command(
    name = "lf-synth",
    version,
    max_term_width = 100,
    after_help = "Examples:
  lf-synth scene demo > scene.json && lf-synth frames scene.json -o frames
  lf-synth scene core --set particles.per_lenslet=0.5 | lf-synth frames - -o core"
)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
    #[command(flatten)]
    common: Common,
}

#[derive(Subcommand)]
enum Task {
    /// Print a ready scene.json; without NAME, list them
    Scene {
        /// Which one
        name: Option<String>,
        /// Change a key before printing, as particles.per_lenslet=0.5
        #[arg(long, value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
    /// Render frames, camera, particles and truth into a folder
    Frames {
        /// scene.json, - for standard input
        #[arg(default_value = "-")]
        scene: PathBuf,
        /// Folder for frame-0000.exr ..., camera.json, particles.csv, truth-0000.lfv ..., flow.exr
        #[arg(short, long, value_name = "DIR")]
        output: PathBuf,
        /// Use this seed instead of the scene's
        #[arg(long)]
        seed: Option<u64>,
    },
    /// Render a flat field
    White {
        /// scene.json, - for standard input
        #[arg(default_value = "-")]
        scene: PathBuf,
        /// White image (EXR), - for standard output
        #[arg(short, long, value_name = "FILE", default_value = "-")]
        output: PathBuf,
        /// Use this seed instead of the scene's
        #[arg(long)]
        seed: Option<u64>,
    },
}

fn main() -> ExitCode {
    cli::run(
        "lf-synth",
        |arguments: &Arguments| &arguments.common,
        |arguments, session| match &arguments.task {
            Task::Scene { name, set } => scene(name.as_deref(), set),
            Task::Frames { scene, output, seed } => frames(scene, output, *seed, session),
            Task::White { scene, output, seed } => white(scene, output, *seed, session),
        },
    )
}

fn save_text(path: &Path, text: &str) -> Result<()> {
    io::save_text(path, |out| out.write_all(text.as_bytes()))
}

fn scene(name: Option<&str>, set: &[String]) -> Result<Verdict> {
    let list = || {
        let lines: Vec<String> = ready::NAMES.iter().map(|(name, about)| format!("{name:16}{about}\n")).collect();
        lines.concat()
    };
    let text = match name {
        None => list(),
        Some(name) => {
            let names: Vec<&str> = ready::NAMES.iter().map(|(name, _)| *name).collect();
            let wanted = || format!("wanted one of {}", names.join(", "));
            let mut scene = ready::scene(name).ok_or_else(|| Error::new(name, "not a ready scene", wanted()))?;
            for words in set {
                ready::set(&mut scene, words).map_err(|found| Error::new("--set", found, "wanted KEY=VALUE"))?;
            }
            format!("{}\n", serde_json::to_string_pretty(&scene).expect("a scene is plain data"))
        }
    };
    save_text(Path::new("-"), &text)?;
    Ok(Verdict::Done)
}

fn open(path: &Path, seed: Option<u64>, session: &mut Session) -> Result<(Scene, Camera)> {
    let (mut scene, camera) = session.phase("read", |_| Scene::open(path))?;
    scene.seed = seed.unwrap_or(scene.seed);
    Ok((scene, camera))
}

fn seed_particles(scene: &Scene, camera: &Camera, velocity: &Velocity) -> Result<Vec<Particle>> {
    if let Some(csv) = &scene.particles.csv {
        let text = io::open_text(csv)?;
        return particles::from_csv(&text).map_err(|found| Error::new(io::name(csv), found, "wanted a particles.csv"));
    }
    let count = scene.particle_count(camera);
    let intensity = scene.particles.intensity;
    Ok(particles::seed_evenly(count, scene.bounds_mm(), velocity, scene.frames, intensity, scene.seed))
}

fn frames(path: &Path, folder: &Path, seed: Option<u64>, session: &mut Session) -> Result<Verdict> {
    let (scene, camera) = open(path, seed, session)?;
    let unseen = scene.unseen_share(&camera);
    if unseen > 0.0 {
        session.warn(format!("{:.1} % of the volume's section lies beside what the sensor sees", 100.0 * unseen));
    }
    let pixel_mm = camera.sensor.pixel_pitch_mm / camera.main_lens.magnification;
    let bounds = scene.bounds_mm();
    let velocity = scene.flow.as_ref().map_or(Velocity::REST, |flow| flow.in_volume(bounds, pixel_mm));
    let seeded = seed_particles(&scene, &camera, &velocity)?;
    let wrong = |found| Error::new(io::name(path), found, "wanted a scene.json");
    let grid = scene.grid(&camera).map_err(wrong)?;
    let history = session.history(&Vec::new());
    let mut inputs = vec![path];
    inputs.extend(scene.particles.csv.as_deref());
    let camera_file = match &scene.camera {
        CameraSource::Path(file) => Some(path.parent().unwrap_or(Path::new("")).join(file)),
        CameraSource::Camera(_) => None,
    };
    inputs.extend(camera_file.as_deref());
    let numbered = |n| [format!("frame-{n:04}.exr"), format!("truth-{n:04}.lfv")];
    let fixed = ["flow.exr", "particles.csv", "camera.json"].map(String::from);
    for name in (0..scene.frames).flat_map(numbered).chain(fixed) {
        session.keep_apart(&folder.join(name), &inputs)?;
    }
    std::fs::create_dir_all(folder).map_err(|error| io::writing(&io::output_name(folder), &error))?;
    let mut shown = Vec::new();
    for frame in 0..scene.frames {
        let lit = particles::at_frame(&seeded, bounds, &velocity, frame as f64);
        let image = session.phase("render", |session| {
            let progress = session.progress("rendering", lit.len() as u64);
            let p = &scene.particles;
            Ok(render::frame(&camera, &lit, p.sigma_px, p.rays, scene.seed ^ ((frame as u64) << 32), |n| {
                progress.add(n)
            }))
        })?;
        session.explain(format!(
            "frame {frame}: {} particles, {:.2} % of their light reached the sensor",
            lit.len(),
            100.0 * image.arrived / image.emitted.max(f64::MIN_POSITIVE)
        ));
        let (indices, intensity) = session.phase("truth", |_| Ok(truth::volume(&grid, &lit, scene.truth.sigma_vox)))?;
        session.phase("write", |_| {
            image::save(&folder.join(format!("frame-{frame:04}.exr")), &image.pixels, &history)?;
            let file = folder.join(format!("truth-{frame:04}.lfv"));
            io::save(&file, |out| volume::write(out, &grid, &indices, &[("intensity", &intensity)], &history))
        })?;
        shown.push(lit);
    }
    session.phase("write", |_| {
        let flow = truth::displacement(&velocity, bounds, scene.truth.vectors, grid.spacing_mm, history.clone());
        flow.save(&folder.join("flow.exr"))?;
        save_text(&folder.join("particles.csv"), &particles::to_csv(&shown))?;
        save_text(&folder.join("camera.json"), &camera.to_json())
    })?;
    session.count("frames", scene.frames);
    session.count("particles", shown.first().map_or(0, Vec::len));
    session.count("rays", shown.iter().map(Vec::len).sum::<usize>() as u64 * u64::from(scene.particles.rays));
    Ok(Verdict::Done)
}

fn white(path: &Path, output: &Path, seed: Option<u64>, session: &mut Session) -> Result<Verdict> {
    session.keep_apart(output, &[path])?;
    let (scene, mut camera) = open(path, seed, session)?;
    if let Some(f_number) = scene.white.working_f_number {
        camera.main_lens.working_f_number = f_number;
    }
    let image = session.phase("render", |session| {
        let lenslets = camera.sensor.height as f64 / camera.pitch_px() + 6.0;
        let progress = session.progress("rendering", lenslets as u64);
        Ok(render::white(&camera, scene.white.counts, scene.white.rays_per_lenslet, scene.seed, |n| progress.add(n)))
    })?;
    session.phase("write", |session| image::save(output, &image.pixels, &session.history(&Vec::new())))?;
    Ok(Verdict::Done)
}
