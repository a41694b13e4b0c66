//! Files that several subcommands read.

use lf_core::camera::Camera;
use lf_core::cli::Session;
use lf_core::volume::Volume;
use lf_core::volume::tile::Tile;
use lf_core::{Error, Result};
use lf_validate::scores::light::Light;
use std::path::Path;

/// Refuses standard input named twice, and a standard output or `--stats` that is also an input.
pub fn check_inputs(inputs: &[&Path], session: &Session) -> Result<()> {
    session.keep_apart(Path::new("-"), inputs)
}

/// Opens a volume. A tile is refused: the light in its halo belongs to its neighbours, so that a score of it means nothing.
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

/// The light of a volume.
pub fn light(volume: &Volume) -> Result<Light<'_>> {
    Ok(Light { grid: volume.grid(), indices: volume.indices(), intensity: volume.require("intensity")? })
}

/// Size of a pixel at the focal plane, mm. None without a camera.
pub fn pixel_mm(camera: Option<&Path>) -> Result<Option<f64>> {
    let camera = camera.map(Camera::open).transpose()?;
    Ok(camera.as_ref().map(Camera::pixel_in_focus_mm))
}
