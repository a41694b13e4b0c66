//! Files that subcommands read.

use super::output::Picture;
use lf_core::flow::{Flows, Velocity};
use lf_core::frame::{self, Frame};
use lf_core::scene::{self, CameraSource, Frames, LitVolume};
use lf_core::{Camera, Error, Field, Particle, Refusal, Result, Session, Tile, Volume, io, json, particles};
use lf_validate::info::FileKind;
use lf_validate::scores::{displacement::TrueDisplacement, displacement::tracks, light::VoxelLight};
use std::path::{Path, PathBuf};

/// Opens a volume. A tile is refused: the light in its halo belongs to its neighbours, so its score means nothing.
pub fn open_whole(path: &Path) -> Result<Volume> {
    let volume = Volume::open(path)?;
    match Tile::of(&volume)? {
        Some(tile) => {
            let found = format!("tile {} of {}", tile.index, tile.of);
            Err(Error::new(volume.name(), found, "wanted a whole volume (only quality takes all tiles of a volume)"))
        }
        None => Ok(volume),
    }
}

/// Bytes as text, without a byte order mark.
pub fn text<'a>(bytes: &'a [u8], name: &str, wanted: &str) -> Result<&'a str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.trim_start_matches('\u{feff}')),
        Err(error) => Err(Error::new(name, format!("byte {} is not part of UTF-8 text", error.valid_up_to()), wanted)),
    }
}

/// The particles of one frame of a table. Refuses a frame without any.
pub fn open_particles(file: &Path, frame: usize, session: &Session) -> Result<Vec<Particle>> {
    let all = particles::open(file, session)?;
    let count = all.len();
    let of_frame: Vec<Particle> = all.into_iter().filter(|particle| particle.frame == frame).collect();
    if of_frame.is_empty() {
        let found = format!("no particle of frame {frame} among {count}");
        return Err(Error::new(io::name(file), found, "wanted a frame that it has"));
    }
    Ok(of_frame)
}

/// The light of a volume.
pub fn light(volume: &Volume) -> Result<VoxelLight<'_>> {
    Ok(VoxelLight { grid: volume.grid(), indices: volume.indices(), intensity: volume.require("intensity")? })
}

/// Size of a pixel at the focal plane, mm. None without a camera.
pub fn pixel_mm(camera: Option<&Path>) -> Result<Option<f64>> {
    let camera = camera.map(Camera::open).transpose()?;
    Ok(camera.as_ref().map(Camera::pixel_in_focus_mm))
}

const WANTED: &str = "wanted a vector field in EXR, a scene.json or a particles.csv";

/// The keys of a scene that describe how its particles move. Other keys are not read.
#[derive(serde::Deserialize)]
struct SceneMotion {
    frame: Option<Frame>,
    camera: CameraSource,
    volume: LitVolume,
    #[serde(default)]
    flow: Option<Flows>,
    #[serde(default)]
    frames: Frames,
}

/// Opens a truth. Its content decides of which kind it is. `frames`: of a particles.csv. Refuses a picture that is also
/// a file which the scene names.
pub fn open_truth(
    file: &Path,
    frames: Option<[usize; 2]>,
    picture: &Picture,
    session: &Session,
) -> Result<TrueDisplacement> {
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
            particles::warn_unmarked(text()?, &name, session);
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
    let value = serde_json::from_str(text).map_err(|error| wrong(format!("not JSON ({error})")))?;
    let mut motion: SceneMotion = json::read(&value).map_err(wrong)?;
    if motion.frame.is_none() {
        let wanted = format!("wanted \"{}\": \"{}\", with x to the right in the picture", frame::KEY, frame::MARK);
        return Err(Error::new(name, "names no frame, as scenes of lf 0.1.0, which have x to the left", wanted));
    }
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
    picture.check(&files, session)?;
    let camera = motion.camera.open(folder, name)?;
    let pixel_mm = camera.pixel_in_focus_mm();
    let velocity = flow.open(motion.volume.bounds_mm(), pixel_mm, name)?;
    Ok(TrueDisplacement::Flow { velocity, interval })
}
