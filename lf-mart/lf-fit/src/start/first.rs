//! The first particles of a camera.

use super::maxima::maxima;
use super::sweeps::{SWEEPS, Sweeps};
use crate::particle::Particle;
use lf_core::{Camera, Refusal, Volume};
use ndarray::ArrayView2;

/// The column of a volume of lf-mart.
const INTENSITY: &str = "intensity";

/// The local maxima of a volume, or of the light that sweeps find on a support. `done` gets the number of sweeps just
/// finished.
pub(crate) fn particles(
    camera: &Camera,
    image: ArrayView2<f32>,
    volume: &Volume,
    done: impl Fn(u64),
) -> Result<Vec<Particle>, Refusal> {
    let (grid, indices) = (volume.grid(), volume.indices());
    if let Some(intensity) = volume.column(INTENSITY) {
        return Ok(maxima(grid, indices, intensity));
    }
    let sweeps = Sweeps::new(camera, grid)?;
    let (indices, light) = sweeps.run(image, indices, done);
    Ok(maxima(sweeps.grid(), &indices, &light))
}

/// Sweeps that [`particles`] takes, and their bytes: none if the volume has intensities.
pub(crate) fn cost(camera: &Camera, volume: &Volume) -> Result<(usize, u64), Refusal> {
    if volume.column(INTENSITY).is_some() {
        return Ok((0, 0));
    }
    Ok((SWEEPS, Sweeps::new(camera, volume.grid())?.bytes(volume.count())))
}
