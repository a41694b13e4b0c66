//! The cameras of a fit with their images and volumes, and where their particles begin.

use super::arguments::Arguments;
use lf_core::camera::Pose;
use lf_core::field::Field;
use lf_core::image::{self, Frame, FrameFiles};
use lf_core::volume::Tile;
use lf_core::{Camera, Error, Refusal, Result, Session, Volume, cli, io, particles};
use lf_fit::{CameraInput, Particle};
use std::path::{Path, PathBuf};

/// The files of a camera.
pub struct Files {
    camera: Camera,
    image: Frame,
    volume: Volume,
}

/// Reads the files of all cameras. Their numbers must agree.
pub fn open(arguments: &Arguments, session: &mut Session) -> Result<Vec<Files>> {
    let one = |n: usize| {
        let file = &arguments.camera[n];
        let camera = Camera::open(file)?;
        let [background, mask] =
            [&arguments.background, &arguments.mask].map(|files| files.get(n).map(PathBuf::as_path));
        let files = FrameFiles { background, mask };
        let image = image::open_signed_frame(&arguments.image[n], files, &camera, file, arguments.reading.channel)?;
        let volume = Volume::open(&arguments.volume[n])?;
        Ok(Files { camera, image, volume })
    };
    session.phase("read", |_| (0..arguments.image.len()).map(one).collect())
}

/// Refuses outputs that overwrite the flat field of a camera, volumes that cannot be fitted, and dark images.
pub fn check(inputs: &[Files], arguments: &Arguments, outputs: &[&Path], session: &Session) -> Result<()> {
    for (n, Files { camera, image, volume }) in inputs.iter().enumerate() {
        let name = &io::name(&arguments.volume[n]);
        let flat = camera.flat_field(&arguments.camera[n]);
        let flat: Vec<&Path> = flat.as_deref().into_iter().collect();
        outputs.iter().try_for_each(|output| session.keep_apart(output, &flat))?;
        if volume.column("score").is_none() {
            volume.require("intensity")?;
        }
        if volume.count() == 0 {
            return Err(Error::new(name, "holds no voxel", "wanted a volume with light"));
        }
        if let Some(tile) = Tile::of(volume)? {
            let found = format!("tile {} of {}", tile.index, tile.of);
            let wanted = "wanted a whole volume: the image also has the light of the other tiles";
            return Err(Error::new(name, found, wanted));
        }
        if image.pixels.iter().all(|value| *value <= 0.0) {
            let name = io::name(&arguments.image[n]);
            return Err(Error::new(name, "no pixel has light", "wanted an image of particles"));
        }
    }
    Ok(())
}

/// The particles of `--start`, moved by its field, in the frame of the first camera. None without that option.
fn given(arguments: &Arguments, session: &Session) -> Result<Option<Vec<Particle>>> {
    let Some(file) = &arguments.start else { return Ok(None) };
    let mut all = particles::open(file, session)?;
    let frames = all.iter().fold([usize::MAX, 0], |[first, last], one| [first.min(one.frame), last.max(one.frame)]);
    if frames[0] < frames[1] {
        let before = arguments.frame.checked_sub(1);
        all.retain(|particle| Some(particle.frame) == before);
        if all.is_empty() {
            let found = format!("holds frames {} to {}", frames[0], frames[1]);
            return Err(Error::new(io::name(file), found, "wanted particles of the frame before --frame"));
        }
    }
    if all.is_empty() {
        return Err(Error::new(io::name(file), "holds no particle", "wanted particles, or no --start"));
    }
    let field = arguments.start_field.as_deref().map(Field::open).transpose()?;
    let follow = |place_mm: [f64; 3]| match &field {
        Some(field) => field.follow(place_mm.into()).map(Into::into),
        None => Some(place_mm),
    };
    let moved: Vec<Particle> =
        all.iter().filter_map(|one| Some(Particle::new(follow(one.place_mm)?, one.intensity))).collect();
    if moved.is_empty() {
        let name = io::name(arguments.start_field.as_deref().unwrap_or(file));
        return Err(Error::new(name, "has no data where the particles are", "wanted their displacements"));
    }
    Ok(Some(moved))
}

/// Finds the first particles of all cameras, or takes those of `--start`. Returns the bytes that this takes at most.
pub fn start(files: Vec<Files>, arguments: &Arguments, session: &mut Session) -> Result<(Vec<CameraInput>, u64)> {
    let (mut inputs, mut most) = (Vec::new(), 0);
    let given = given(arguments, session)?;
    let pose = files[0].camera.pose;
    for (n, Files { camera, image, volume }) in files.into_iter().enumerate() {
        let name = io::name(&arguments.volume[n]);
        let about = |refusal: Refusal| refusal.about(name.clone());
        let (sweeps, bytes) = CameraInput::sweeps(&camera, &volume).map_err(about)?;
        if sweeps > 0 {
            let what = || format!("sweeps over {} voxels", volume.count());
            cli::check_memory(arguments.memory, bytes as f64, name.clone(), what)?;
        }
        let input = match &given {
            Some(first) => {
                let pose = Pose::between(pose.as_ref(), camera.pose.as_ref());
                let to_camera = |one: &Particle| Particle { place_mm: pose.to_camera(one.place_mm), ..*one };
                CameraInput::given(camera, image, volume, first.iter().map(to_camera).collect())
            }
            None => session.phase("start", |session| {
                let progress = session.progress("sweeps", sweeps as u64);
                CameraInput::new(camera, image, volume, |done| progress.add(done)).map_err(about)
            })?,
        };
        let found = input.first_particles();
        session.explain(if given.is_some() {
            format!("{found} first particles, of --start")
        } else if sweeps > 0 {
            format!("{found} first particles, by {sweeps} sweeps over the voxels of {name}")
        } else {
            format!("{found} first particles, the local maxima of {name}")
        });
        inputs.push(input);
        most = most.max(bytes);
    }
    Ok((inputs, most))
}
