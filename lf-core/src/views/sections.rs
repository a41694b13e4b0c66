//! The sections of the aperture that rays pass.

use crate::camera::{Aperture, Disc};
use crate::light::{StopLight, Tones, fewest_particles};
use crate::{Camera, Grid, Refusal, statistics::ranked, weights::sections};
use glam::DVec2;
use ndarray::ArrayView2;

/// A section is dark if its light is below this share of the upper quartile of all sections. On the scenes of
/// `scripts/studies/study prune-cameras` closed sections have at most 0.3 of it, open ones 0.5 or more.
const LIT_SHARE: f64 = 0.4;

/// A section is surely closed if its light is this many standard deviations below the usual one.
const SURE: f64 = 3.0;

/// With fewer particles no section is surely closed. A single one may show half the stop, at the side of the sensor.
const FEWEST_PARTICLES: f64 = 4.0;

/// The sections of the aperture.
pub struct Sections {
    /// Centres along either axis, mm.
    centres_mm: Vec<f64>,
    /// Whether rays through section (u, v) are traced, at `[v n + u]`.
    traced: Vec<bool>,
}

impl Sections {
    /// n x n sections: `asked`, or the number of pixels under a lenslet. Refuses n outside
    /// [`crate::weights::SECTIONS`]. A section lies inside the stop if its centre does. A round stop has no
    /// corner sections, nor has an iris; if they counted, every voxel would be pruned.
    pub fn new(camera: &Camera, asked: Option<usize>) -> Result<Self, Refusal> {
        let n = sections(camera, asked)?;
        let half = 0.5 * camera.aperture_mm();
        let centres_mm: Vec<f64> = (0..n).map(|i| half * ((2 * i + 1) as f64 / n as f64 - 1.0)).collect();
        let blades: Vec<Disc> = camera.blades.iter().flat_map(|blades| blades.aperture_discs(half)).collect();
        let is_inside = |place: DVec2| match camera.main_lens.aperture {
            Aperture::Square => true,
            Aperture::Circle => place.length_squared() <= half * half && blades.iter().all(|blade| blade.holds(place)),
        };
        let places = centres_mm.iter().flat_map(|v| centres_mm.iter().map(|u| DVec2::new(*u, *v)));
        let traced = places.map(is_inside).collect();
        Ok(Self { centres_mm, traced })
    }

    /// The sections that let at least 0.4 of the usual light through in this image, and the number of the others that
    /// are surely closed. A smaller stop than the camera says, or a shadow in it, leaves sections dark for every voxel.
    /// So do a few particles; these sections are not surely closed. If the image has no light, all count as lit.
    pub fn lit(&self, image: ArrayView2<f32>, camera: &Camera, grid: &Grid) -> (Self, u32) {
        let tones = Tones::new(image);
        let StopLight { means, samples } = StopLight::new(image, camera, &tones, &self.traced_mm());
        // Blind pixels may hide a section, which is then neither lit nor closed.
        let mut shown: Vec<f64> = means.iter().copied().filter(|light| !light.is_nan()).collect();
        let rank = shown.len() * 3 / 4;
        let usual = ranked(&mut shown, rank).unwrap_or(0.0);
        let ends_mm = [0, grid.shape[2] - 1].map(|z| grid.centre_mm(2, z));
        let sure = LIT_SHARE.min(1.0 - SURE / samples.sqrt()) * usual;
        let is_crowded = || fewest_particles(image, camera, &tones, ends_mm) >= FEWEST_PARTICLES;
        let closed = means.iter().filter(|light| **light < sure).count() as u32;
        let closed = if closed > 0 && is_crowded() { closed } else { 0 };
        let mut means = means.into_iter();
        let is_bright = |light: f64| usual == 0.0 || light >= LIT_SHARE * usual;
        let is_lit = |traced: &bool| *traced && means.next().is_some_and(is_bright);
        let traced = self.traced.iter().map(is_lit).collect();
        (Self { centres_mm: self.centres_mm.clone(), traced }, closed)
    }

    /// Number of sections that are traced.
    pub fn count(&self) -> u32 {
        self.traced.iter().filter(|traced| **traced).count() as u32
    }

    /// Centres of the traced sections, mm, row by row.
    pub fn traced_mm(&self) -> Vec<DVec2> {
        let n = self.centres_mm.len();
        let traced = (0..n * n).filter(|place| self.traced[*place]);
        traced.map(|place| DVec2::new(self.centres_mm[place % n], self.centres_mm[place / n])).collect()
    }
}
