//! Files that several subcommands read.

use lf_core::{Camera, Error, Result, Tile, Volume};
use lf_validate::scores::light::VoxelLight;
use std::path::Path;

/// Opens a volume. A tile is refused: the light in its halo belongs to its neighbours, so that a score of it means
/// nothing.
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

/// The light of a volume.
pub fn light(volume: &Volume) -> Result<VoxelLight<'_>> {
    Ok(VoxelLight { grid: volume.grid(), indices: volume.indices(), intensity: volume.require("intensity")? })
}

/// Size of a pixel at the focal plane, mm. None without a camera.
pub fn pixel_mm(camera: Option<&Path>) -> Result<Option<f64>> {
    let camera = camera.map(Camera::open).transpose()?;
    Ok(camera.as_ref().map(Camera::pixel_in_focus_mm))
}
