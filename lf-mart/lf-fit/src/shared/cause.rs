//! The likely cause where a camera does not explain its image: one parameter at a time is moved, the particles follow,
//! and the fall of the squares is foreseen from their slopes (a score test).

use super::shape_fit::Sample;
use crate::cameras::view::{CameraView, Cameras};
use crate::model::buffers::FitBuffers;
use crate::model::particle_image::ParticleImage;
use crate::solve::normal::{DEEP, Normal, conjugate_gradients, dot};
use lf_core::{Camera, Refusal};
use rayon::prelude::*;

/// A camera's parameter that would explain more of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cause {
    /// Its name in messages.
    pub name: &'static str,
    /// Its unit in messages.
    pub unit: &'static str,
    /// How far it is foreseen to be too small, in that unit.
    pub step: f64,
    /// Its share of the squared differences in excess of the noise.
    pub share: f64,
}

/// A parameter: its name and unit, a small step in that unit, and how a camera takes a step.
type Parameter = (&'static str, &'static str, f64, fn(&mut Camera, f64));

/// A distance of the sensor that is too short looks as an f-number that is too large, because depths follow.
const PARAMETERS: [Parameter; 3] = [
    ("f-number (or 1 / focal_length_mm of the lenslets)", "%", 0.2, |camera, by| {
        camera.main_lens.working_f_number *= 1.0 + 0.01 * by;
    }),
    ("pitch of the lenslets", "%", 0.005, |camera, by| camera.microlenses.pitch_mm *= 1.0 + 0.01 * by),
    ("rotation of the lenslets", "mrad", 0.05, |camera, by| camera.microlenses.rotation_rad += 1e-3 * by),
];
/// A cause has at least this share of the excess.
const LEAST_SHARE: f64 = 0.2;
/// Damping of the particles' equations.
const DAMPING: f64 = 1e-3;

impl Sample<'_> {
    /// The parameter that explains most; None if none explains a fifth. The differences of neighbouring pixels
    /// correlate by `alike`: what they share is no noise, even if the noise was found from them.
    pub(crate) fn cause(&self, alike: f64) -> Result<Option<Cause>, Refusal> {
        let view = self.cameras.first();
        let columns = self.window.columns;
        let mut buffers = FitBuffers::default();
        let images = self.images(&self.cameras);
        // The equations of the particles.
        buffers.fit(self.window.seen.len());
        buffers.paint(images.iter(), columns);
        self.cameras.weigh(&self.window, &mut buffers);
        let normal = Normal::new(images.iter(), columns, &mut buffers);
        let own = conjugate_gradients(&normal, &normal.gradient, DAMPING, DEEP);
        let lit = buffers.touched.iter().map(|n| *n as usize).filter(|n| buffers.weight[*n] > 0.0);
        let squares: Vec<f64> =
            lit.map(|n| f64::from(buffers.residual[n]).powi(2) / f64::from(buffers.weight[n])).collect();
        let sum: f64 = squares.iter().sum();
        let excess = (sum - squares.len() as f64).max(alike * sum);

        let mut best: Option<Cause> = None;
        for (name, unit, small, change) in PARAMETERS {
            // Slopes of the sample's light by the parameter.
            let mut lights = [-1.0, 1.0].map(|sign| {
                let mut camera = view.camera.clone();
                change(&mut camera, sign * small);
                let model = view.shape.model(&camera, view.depth_mm)?;
                let moved = Cameras { views: vec![CameraView { model, expected: Vec::new(), halo: None, ..*view }] };
                let mut light = vec![0f32; self.window.seen.len()];
                self.images(&moved).iter().for_each(|image| image.add_to(&mut light, columns, 1.0));
                Ok(light)
            });
            let after = std::mem::replace(&mut lights[1], Ok(Vec::new()))?;
            let before = std::mem::replace(&mut lights[0], Ok(Vec::new()))?;
            let slope = |n: usize| (after[n] - before[n]) / (2.0 * small) as f32;

            // The fall of the squares by the parameter while the particles follow.
            let (mut gradient, mut square) = (0.0, 0.0);
            for n in &buffers.touched {
                let (n, slope) = (*n as usize, f64::from(slope(*n as usize)));
                gradient += slope * f64::from(buffers.residual[n]);
                square += slope * slope * f64::from(buffers.weight[n]);
            }
            let mixed = self.mixed(&images, slope, &buffers);
            let solved = conjugate_gradients(&normal, &mixed, DAMPING, DEEP);
            let (right, reduced) = (gradient - dot(&mixed, &own), square - dot(&mixed, &solved));
            let share = right * right / reduced / excess;
            if reduced > 0.0 && share > best.map_or(LEAST_SHARE, |best| best.share) {
                best = Some(Cause { name, unit, step: right / reduced, share: share.min(1.0) });
            }
        }
        Ok(best)
    }

    /// The images of the sample's particles.
    fn images(&self, cameras: &Cameras) -> Vec<ParticleImage> {
        let render = |scratch: &mut _, particle: &_| ParticleImage::new(cameras, particle, &self.window, scratch);
        self.particles.par_iter().map_init(Default::default, render).collect()
    }
}
