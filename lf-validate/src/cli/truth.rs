//! The true displacement, from a field, a scene or particles.

use super::{inputs::text, picture::Picture};
use lf_core::flow::{Flows, Velocity};
use lf_core::scene::{self, CameraSource, Frames, LitVolume};
use lf_core::{Error, Field, Refusal, Result, Session, io, particles};
use lf_validate::info::FileKind;
use lf_validate::scores::displacement::TrueDisplacement;
use lf_validate::scores::displacement::tracks;
use std::path::{Path, PathBuf};

const WANTED: &str = "wanted a vector field in EXR, a scene.json or a particles.csv";

/// The keys of a scene that describe how its particles move. Other keys are not read.
#[derive(serde::Deserialize)]
struct Motion {
    camera: CameraSource,
    volume: LitVolume,
    #[serde(default)]
    flow: Option<Flows>,
    #[serde(default)]
    frames: Frames,
}

/// Opens a truth. Its content decides of which kind it is. `frames`: of a particles.csv. Refuses a picture that is also
/// a file which the scene names.
pub fn open(file: &Path, frames: Option<[usize; 2]>, picture: &Picture, session: &Session) -> Result<TrueDisplacement> {
    let (bytes, name) = (io::open(file)?, io::name(file));
    let refused = |found: String| Error::new(&name, found, WANTED);
    let text = || text(&bytes, &name, WANTED);
    let kind = FileKind::of(&bytes).map_err(|refusal| refused(refusal.found))?;
    if frames.is_some() && kind != FileKind::Particles {
        return Err(Error::new("--frames", format!("{name} is not a particles.csv"), "wanted --frames only with one"));
    }
    match kind {
        FileKind::Json => flow(text()?, file, &name, picture, session),
        FileKind::Particles => {
            let named = |refusal: Refusal| refusal.about(&name);
            let particles = particles::read(text()?).map_err(named)?;
            Ok(TrueDisplacement::Tracks(tracks(&particles, frames.unwrap_or([0, 1])).map_err(named)?))
        }
        FileKind::Volume | FileKind::Table | FileKind::Centres | FileKind::Vti | FileKind::Picture => {
            Err(refused("another kind of file".to_owned()))
        }
        FileKind::Field | FileKind::Image => Ok(TrueDisplacement::Field(Box::new(Field::from_bytes(&bytes, &name)?))),
    }
}

/// The flow of a scene: the one that `lf-synth` samples in `flow.exr`.
fn flow(text: &str, file: &Path, name: &str, picture: &Picture, session: &Session) -> Result<TrueDisplacement> {
    let wrong = |found: String| Error::new(name, found, scene::WANTED);
    let mut motion: Motion = serde_json::from_str(text).map_err(|error| wrong(error.to_string()))?;
    let folder = file.parent().unwrap_or(Path::new(""));
    motion.volume.check().and_then(|()| motion.frames.check()).map_err(|refusal| refusal.about(name))?;
    let interval = motion.frames.interval();
    let Some(flow) = &mut motion.flow else {
        return Ok(TrueDisplacement::Flow { velocity: Velocity::rest(), interval });
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
    picture.check(&files, session)?;
    let camera = motion.camera.open(folder, name)?;
    let pixel_mm = camera.pixel_in_focus_mm();
    let velocity = flow.open(motion.volume.bounds_mm(), pixel_mm, name)?;
    Ok(TrueDisplacement::Flow { velocity, interval })
}
