//! The cameras of a fit with their images and volumes.

use super::arguments::Arguments;
use lf_core::image::{self, Frame, FrameFiles};
use lf_core::volume::Tile;
use lf_core::{Camera, Error, Refusal, Result, Session, Volume, cli, io};
use lf_fit::CameraInput;
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

/// Finds the first particles of all cameras. Returns the bytes that this took at most.
pub fn start(files: Vec<Files>, arguments: &Arguments, session: &mut Session) -> Result<(Vec<CameraInput>, u64)> {
    let (mut inputs, mut most) = (Vec::new(), 0);
    for (n, Files { camera, image, volume }) in files.into_iter().enumerate() {
        let name = io::name(&arguments.volume[n]);
        let about = |refusal: Refusal| refusal.about(name.clone());
        let (sweeps, bytes) = CameraInput::sweeps(&camera, &volume).map_err(about)?;
        if sweeps > 0 {
            let what = || format!("sweeps over {} voxels", volume.count());
            cli::check_memory(arguments.memory, bytes as f64, name.clone(), what)?;
        }
        let input = session.phase("start", |session| {
            let progress = session.progress("sweeps", sweeps as u64);
            CameraInput::new(camera, image, volume, |done| progress.add(done)).map_err(about)
        })?;
        let found = input.first_particles();
        session.explain(if sweeps > 0 {
            format!("{found} first particles, by {sweeps} sweeps over the voxels of {name}")
        } else {
            format!("{found} first particles, the local maxima of {name}")
        });
        inputs.push(input);
        most = most.max(bytes);
    }
    Ok((inputs, most))
}
