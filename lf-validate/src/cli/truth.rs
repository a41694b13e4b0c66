//! The true displacement, from whatever tells it.

use super::picture::Picture;
use lf_core::cli::Session;
use lf_core::field::Field;
use lf_core::flow::{Flows, Velocity};
use lf_core::scene::{self, CameraSource, Frames, LitVolume};
use lf_core::{Error, Refusal, Result, io, particles};
use lf_validate::info::Kind;
use lf_validate::scores::displacement::Truth;
use lf_validate::scores::displacement::tracks;
use std::path::{Path, PathBuf};

const WANTED: &str = "wanted a vector field in EXR, a scene.json or a particles.csv";

/// The keys of a scene that say how its particles move; the others are not read.
#[derive(serde::Deserialize)]
struct Motion {
    camera: CameraSource,
    volume: LitVolume,
    #[serde(default)]
    flow: Option<Flows>,
    #[serde(default)]
    frames: Frames,
}

/// Reads a truth, which its content tells; `frames` of a particles.csv. No file that it names may be the picture's.
pub fn open(file: &Path, frames: Option<[usize; 2]>, picture: &Picture, session: &Session) -> Result<Truth> {
    let (bytes, name) = (io::open(file)?, io::name(file));
    let refused = |found: String| Error::new(&name, found, WANTED);
    let text = || match std::str::from_utf8(&bytes) {
        Ok(text) => Ok(text.trim_start_matches('\u{feff}')),
        Err(error) => Err(refused(format!("byte {} is not part of UTF-8 text", error.valid_up_to()))),
    };
    let kind = Kind::of(&bytes).map_err(refused)?;
    if frames.is_some() && kind != Kind::Particles {
        return Err(Error::new("--frames", format!("{name} is no particles.csv"), "wanted it with one, or not at all"));
    }
    match kind {
        Kind::Json => flow(text()?, file, &name, picture, session),
        Kind::Particles => {
            let named = |refusal: Refusal| refusal.about(&name);
            let particles = particles::read(text()?).map_err(named)?;
            Ok(Truth::Tracks(tracks(&particles, frames.unwrap_or([0, 1])).map_err(named)?))
        }
        Kind::Volume | Kind::Table | Kind::Centres | Kind::Vti | Kind::Picture => {
            Err(refused("another kind of file".to_owned()))
        }
        Kind::Field | Kind::Image => Ok(Truth::Field(Box::new(Field::from_bytes(&bytes, &name)?))),
    }
}

/// The flow of a scene, as `lf-synth` writes it into `flow.exr`.
fn flow(text: &str, file: &Path, name: &str, picture: &Picture, session: &Session) -> Result<Truth> {
    let wrong = |found: String| Error::new(name, found, scene::WANTED);
    let mut motion: Motion = serde_json::from_str(text).map_err(|error| wrong(error.to_string()))?;
    let folder = file.parent().unwrap_or(Path::new(""));
    motion.volume.check().and_then(|()| motion.frames.check()).map_err(|refusal| refusal.about(name))?;
    let interval = motion.frames.interval();
    let Some(flow) = &mut motion.flow else {
        return Ok(Truth::Flow { velocity: Velocity::rest(), interval });
    };
    flow.check().map_err(|refusal| refusal.about(name))?;
    if flow.tracks().is_some() {
        let found = "a flow of tracks, which is known at its particles only";
        return Err(Error::new(name, found, "wanted a steady flow, or the particles.csv itself"));
    }
    flow.join(folder);
    let mut files: Vec<PathBuf> = flow.sampled().into_iter().map(Path::to_path_buf).collect();
    files.extend(motion.camera.file(folder));
    let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    session.keep_apart(Path::new("-"), &files)?;
    picture.check(&files, session)?;
    let camera = motion.camera.open(folder, name)?;
    let pixel_mm = camera.pixel_in_focus_mm();
    let velocity = flow.open(motion.volume.bounds_mm(), pixel_mm, name)?;
    Ok(Truth::Flow { velocity, interval })
}
