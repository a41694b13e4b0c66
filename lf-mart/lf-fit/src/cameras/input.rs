//! A camera as the fit gets it.

use crate::cameras::view::depths_mm;
use crate::particle::Particle;
use crate::start::first;
use lf_core::image::Frame;
use lf_core::{Camera, Grid, Refusal, Volume};
use ndarray::{Array2, ArrayView2, CowArray, Ix2};

/// A camera, its image, and the volume made from that image in the camera's own frame.
pub struct CameraInput {
    /// The camera. Its pose places it among the others.
    pub camera: Camera,
    /// Its image, not divided by its flat field; NaN where a pixel is blind.
    pub image: Frame,
    /// A volume with a column `intensity`, or a support without.
    pub volume: Volume,
    /// The first particles. The scale of their light is free.
    pub(crate) first: Vec<Particle>,
    /// Whether they were given. The fit then looks for others in what they leave of the image.
    pub(crate) is_given: bool,
}

/// Counts over the flat field.
fn evened<'i>(counts: ArrayView2<'i, f32>, flat: Option<&Array2<f32>>) -> CowArray<'i, f32, Ix2> {
    flat.map_or_else(|| counts.into(), |flat| (&counts / flat).into())
}

impl CameraInput {
    /// Finds the first particles: the local maxima of the volume, or of the light that sweeps find on a support.
    /// `done` gets the number of sweeps just finished.
    pub fn new(camera: Camera, image: Frame, volume: Volume, done: impl Fn(u64)) -> Result<Self, Refusal> {
        let pixels = evened(image.pixels.view(), image.flat.as_ref());
        let first = first::particles(&camera, pixels.view(), &volume, done)?;
        Ok(Self { camera, image, volume, first, is_given: false })
    }

    /// Takes first particles, in the frame of the camera, such as those of the frame before. It leaves out those beyond
    /// the depths of the volume and those without light.
    pub fn given(camera: Camera, image: Frame, volume: Volume, mut first: Vec<Particle>) -> Self {
        let [low, high] = depths_mm(&camera, volume.grid());
        first.retain(|particle| particle.light > 0.0 && (low..=high).contains(&particle.place_mm[2]));
        Self { camera, image, volume, first, is_given: true }
    }

    /// The particles of an image on this support, such as an image without what a fit explains. A volume with
    /// intensities gives its own maxima, whatever the image.
    pub(crate) fn particles_in(&self, image: ArrayView2<f32>) -> Result<Vec<Particle>, Refusal> {
        let pixels = evened(image, self.image.flat.as_ref());
        first::particles(&self.camera, pixels.view(), &self.volume, |_| ())
    }

    /// Whether a particle lies between the sides of the volume.
    pub(crate) fn holds(&self, particle: &Particle) -> bool {
        let Grid { shape, spacing_mm, origin_mm } = self.volume.grid();
        (0..2).all(|axis| {
            let place = (particle.place_mm[axis] - origin_mm[axis]) / spacing_mm[axis];
            (-0.5..shape[axis] as f64 - 0.5).contains(&place)
        })
    }

    /// Number of sweeps of [`CameraInput::new`], and their bytes.
    pub fn sweeps(camera: &Camera, volume: &Volume) -> Result<(usize, u64), Refusal> {
        first::cost(camera, volume)
    }

    /// Number of first particles.
    pub fn first_particles(&self) -> usize {
        self.first.len()
    }
}
