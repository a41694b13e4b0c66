//! Particles, and how they move from frame to frame.

use super::sheet::Sheet;
use glam::DVec3;
use lf_core::flow::Velocity;
use rayon::prelude::*;

/// A particle in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Number of the particle, the same in every frame.
    pub id: u64,
    /// Place, mm.
    pub place_mm: DVec3,
    /// Counts that it sends through the aperture.
    pub intensity: f64,
    /// Size of its image, relative to the scene's.
    pub size: f64,
}

/// The particles inside the bounds: low bound included, high bound excluded.
pub fn inside(particles: &[Particle], bounds_mm: [[f64; 2]; 3]) -> Vec<Particle> {
    let is_inside = |place: DVec3| (0..3).all(|axis| (bounds_mm[axis][0]..bounds_mm[axis][1]).contains(&place[axis]));
    particles.iter().filter(|particle| is_inside(particle.place_mm)).copied().collect()
}

/// Where the particles of the frames come from.
pub enum Tracers {
    /// A flow carries them from frame to frame.
    Carried {
        /// All particles at `time`, also those outside the volume.
        all: Vec<Particle>,
        /// The flow.
        velocity: Velocity,
        /// Time of `all`.
        time: f64,
    },
    /// A table gives them for each frame.
    Given(Vec<Vec<Particle>>),
}

impl Tracers {
    /// The particles of frame number `frame` at `time` that are inside the bounds and lit, with the sheet's brightness
    /// in their intensities. Ask for the frames in their order.
    pub fn lit(&mut self, frame: usize, time: f64, bounds_mm: [[f64; 2]; 3], light: Option<&Sheet>) -> Vec<Particle> {
        let mut lit = match self {
            Self::Given(frames) => inside(&frames[frame], bounds_mm),
            Self::Carried { all, velocity, time: from } => {
                carry(all, velocity, *from, time);
                *from = time;
                inside(all, bounds_mm)
            }
        };
        if let Some(light) = light {
            lit.iter_mut().for_each(|particle| particle.intensity *= light.brightness(particle.place_mm.z));
            lit.retain(|particle| particle.intensity > 0.0);
        }
        lit
    }

    /// The most particles of a frame.
    pub fn most(&self) -> &[Particle] {
        match self {
            Self::Carried { all, .. } => all,
            Self::Given(frames) => frames.iter().max_by_key(|frame| frame.len()).map_or(&[], Vec::as_slice),
        }
    }
}

/// Moves particles with the flow from one time to another.
pub(super) fn carry(particles: &mut [Particle], velocity: &Velocity, from: f64, to: f64) {
    if from != to {
        particles.par_iter_mut().for_each(|particle| particle.place_mm = velocity.carry(particle.place_mm, to - from));
    }
}
