//! What each task reads and writes.

pub mod frames;

use crate::{Format, Source};
use lf_core::camera::Camera;
use lf_core::cli::Session;
use lf_core::scene::CameraSource;
use lf_core::{Error, Result, image, io};
use lf_synth::diffraction::Pattern;
use lf_synth::render::{Instrument, Rendered};
use lf_synth::{Scene, particles, ready};
use ndarray::Array2;
use std::path::{Path, PathBuf};

/// A scene as read: checked, with its camera, its background image and the files it was made from.
struct Stage {
    scene: Scene,
    camera: Camera,
    background: Option<Array2<f32>>,
    inputs: Vec<PathBuf>,
}

impl Stage {
    fn open(source: &Source, session: &mut Session) -> Result<Self> {
        session.phase("read", |session| {
            let (mut scene, camera, mut inputs) = Scene::open(&source.scene)?;
            session.explain(format!("camera: {}", camera.about()));
            inputs.push(source.scene.clone());
            scene.seed = source.seed.unwrap_or(scene.seed);
            session.explain(format!(
                "seed {}, {}",
                scene.seed,
                if source.seed.is_some() { "as typed" } else { "the scene's" }
            ));
            let shape = (camera.sensor.height, camera.sensor.width);
            let file = scene.sensor_noise.as_ref().and_then(|noise| noise.background.as_deref());
            let background = file.map(|file| background(file, shape)).transpose()?;
            Ok(Self { background, scene, camera, inputs })
        })
    }

    fn instrument(&self) -> Instrument {
        let pattern = self.scene.diffraction.as_ref().map(|diffraction| Pattern::new(diffraction, &self.camera));
        Instrument::new(&self.camera, self.scene.second_stop, pattern)
    }

    /// Refuses to write over what the scene was made from.
    fn keep_apart(&self, output: &Path, session: &Session) -> Result<()> {
        let inputs: Vec<&Path> = self.inputs.iter().map(PathBuf::as_path).collect();
        session.keep_apart(output, &inputs)
    }

    /// What the sensor makes of an image.
    fn record(&self, pixels: &mut Array2<f32>, number: usize, session: &mut Session) -> Result<()> {
        let Some(noise) = &self.scene.sensor_noise else { return Ok(()) };
        let recorded =
            session.phase("record", |_| Ok(noise.record(pixels, self.background.as_ref(), self.scene.seed, number)))?;
        if recorded.clipped > 0 {
            session.warn(format!("image {number}: {} pixels are full", recorded.clipped));
        }
        Ok(())
    }

    /// The scene with everything in it that a run took from elsewhere.
    fn used(&self) -> String {
        let mut scene = self.scene.clone();
        let camera = serde_json::to_value(&self.camera).expect("a camera is plain data");
        scene.camera = CameraSource::Camera(camera);
        format!("{}\n", serde_json::to_string_pretty(&scene).expect("a scene is plain data"))
    }
}

/// Reads an image of counts of shape (height, width).
fn background(file: &Path, shape: (usize, usize)) -> Result<Array2<f32>> {
    let pixels = image::open_counts(file)?.pixels;
    if pixels.dim() == shape {
        return Ok(pixels);
    }
    let found = format!("background of {} x {} px", pixels.ncols(), pixels.nrows());
    Err(Error::new(io::name(file), found, format!("wanted the sensor's {} x {} px", shape.1, shape.0)))
}

/// Refuses a folder to write into that is a file.
fn check_folder(folder: &Path) -> Result<()> {
    match std::fs::metadata(folder) {
        Ok(found) if !found.is_dir() => {
            Err(Error::new(io::output_name(folder), "a file", "wanted a folder to write into"))
        }
        _ => Ok(()),
    }
}

fn save_text(path: &Path, text: &str) -> Result<()> {
    io::save_text(path, |out| out.write_all(text.as_bytes()))
}

fn save_image(path: &Path, pixels: &Array2<f32>, session: &mut Session) -> Result<()> {
    let tiff = path.extension().is_some_and(|end| ["tif", "tiff"].iter().any(|known| end.eq_ignore_ascii_case(known)));
    if tiff {
        let cut = image::outside_u16(pixels);
        if cut > 0 {
            session.warn(format!("{}: {cut} pixels outside 0 to 65535 are cut", io::output_name(path)));
        }
    }
    session.phase("write", |session| image::save(path, pixels, &session.history(&Vec::new())))
}

/// Says how much of the light arrived, and what the rays cost.
fn report(what: &str, image: &Rendered, seconds: f64, session: &Session) {
    session.explain(format!(
        "{what}: {:.2} % of the light reached the sensor; {:.1} million rays, {:.0} million a second",
        100.0 * image.arrived / image.emitted.max(f64::MIN_POSITIVE),
        1e-6 * image.rays as f64,
        1e-6 * image.rays as f64 / seconds.max(1e-9),
    ));
}

pub fn scene(name: Option<&str>, set: &[String]) -> Result<()> {
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
            serde_json::from_value::<Scene>(scene.clone()).map_err(|error| {
                Error::new("--set", error.to_string(), "wanted keys and values that a scene.json has")
            })?;
            format!("{}\n", serde_json::to_string_pretty(&scene).expect("a scene is plain data"))
        }
    };
    save_text(Path::new("-"), &text)
}

pub fn white(source: &Source, output: &Path, session: &mut Session) -> Result<()> {
    let mut stage = Stage::open(source, session)?;
    stage.keep_apart(output, session)?;
    io::check_place(output)?;
    let (seed, white) = (stage.scene.seed, stage.scene.white.clone());
    if let Some(f_number) = white.working_f_number {
        stage.camera.main_lens.working_f_number = f_number;
    }
    let mut image = session.phase("render", |session| {
        // The rows that the renderer counts: those of the sensor, and three on either side.
        let rows = stage.camera.sensor.height as f64 / stage.camera.pitch_px() + 6.0;
        let progress = session.progress("rows", rows.ceil() as u64);
        let instrument = stage.instrument();
        let started = std::time::Instant::now();
        let image = instrument.white(&stage.camera, white.counts, white.rays_per_lenslet, seed, |n| progress.add(n));
        report("white", &image, started.elapsed().as_secs_f64(), session);
        session.count("rays", image.rays);
        Ok(image)
    })?;
    stage.record(&mut image.pixels, WHITE, session)?;
    save_image(output, &image.pixels, session)
}

/// Numbers of the images that are not frames, for their noise.
const WHITE: usize = 1 << 30;
const DARK: usize = 2 << 30;
const DOTS: usize = 3 << 30;

pub fn dark(source: &Source, output: &Path, session: &mut Session) -> Result<()> {
    let mut stage = Stage::open(source, session)?;
    stage.keep_apart(output, session)?;
    if stage.scene.sensor_noise.is_none() {
        session.warn("the scene has no 'sensor_noise': the dark image is black");
    }
    // The background is light, and the cap is on.
    stage.background = None;
    let mut pixels = Array2::zeros((stage.camera.sensor.height, stage.camera.sensor.width));
    stage.record(&mut pixels, DARK, session)?;
    save_image(output, &pixels, session)
}

pub fn dots(source: &Source, folder: &Path, format: Format, session: &mut Session) -> Result<()> {
    check_folder(folder)?;
    let stage = Stage::open(source, session)?;
    let Some(dots) = &stage.scene.dots else {
        let found = "has no key 'dots'";
        return Err(Error::new(io::name(&source.scene), found, "wanted one, as `lf-synth scene target` has it"));
    };
    let names: Vec<String> = (0..dots.depths_mm.len()).map(|n| format!("dots-{n:04}.{}", format.extension())).collect();
    for name in names.iter().map(String::as_str).chain(["dots.csv", "camera.json", "scene-used.json"]) {
        stage.keep_apart(&folder.join(name), session)?;
    }
    let half_view = stage.camera.half_view_mm();
    let targets: Vec<_> = dots.depths_mm.iter().map(|depth| dots.target(half_view, *depth)).collect();
    std::fs::create_dir_all(folder).map_err(|error| io::writing(&io::output_name(folder), &error))?;
    let instrument = stage.instrument();
    let glow = dots.glow(stage.scene.rays(dots.intensity));
    for (n, (target, name)) in targets.iter().zip(&names).enumerate() {
        let mut image = session.phase("render", |session| {
            let progress = session.progress("dots", target.len() as u64);
            let seed = stage.scene.seed ^ ((n as u64) << 32);
            let started = std::time::Instant::now();
            let image = instrument.frame(target, &glow, seed, |n| progress.add(n));
            report(&format!("depth {n}"), &image, started.elapsed().as_secs_f64(), session);
            Ok(image)
        })?;
        stage.record(&mut image.pixels, DOTS + n, session)?;
        save_image(&folder.join(name), &image.pixels, session)?;
    }
    session.phase("write", |_| {
        save_text(&folder.join("dots.csv"), &particles::to_csv(&targets))?;
        save_text(&folder.join("camera.json"), &stage.camera.to_json())?;
        save_text(&folder.join("scene-used.json"), &stage.used())
    })?;
    session.count("dots", targets.first().map_or(0, Vec::len));
    session.count("depths", targets.len());
    Ok(())
}
