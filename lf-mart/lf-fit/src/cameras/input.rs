//! A camera as the fit gets it.

use lf_core::image::Frame;
use lf_core::{Camera, Grid, Volume};

/// A camera, its image, and the volume made from that image in the camera's own frame.
pub struct CameraInput {
    /// The camera. Its pose places it among the others.
    pub camera: Camera,
    /// Its image; NaN where a pixel is blind.
    pub image: Frame,
    /// A volume with a column `intensity`.
    pub volume: Volume,
}

impl CameraInput {
    /// Grid, rising indices and intensities of the voxels.
    pub fn voxels(&self) -> (&Grid, &[u64], &[f32]) {
        (self.volume.grid(), self.volume.indices(), self.volume.column("intensity").unwrap_or_default())
    }
}
