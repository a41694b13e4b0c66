//! The particles of frame after frame.

use crate::light::Sheet;
use crate::particles::{self, Particle};
use lf_core::flow::Velocity;

/// Where the particles of the frames come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Cast {
    /// Carried by a flow from frame to frame.
    Carried {
        /// All of them, also those outside the volume, at `time`.
        all: Vec<Particle>,
        /// What carries them.
        velocity: Velocity,
        /// When they are where they are.
        time: f64,
    },
    /// Given for each frame.
    Given(Vec<Vec<Particle>>),
}

impl Cast {
    /// Particles of frame number `frame` at `time` that are inside the bounds and lit, and how brightly. Frames come in turn.
    pub fn at(&mut self, frame: usize, time: f64, bounds_mm: [[f64; 2]; 3], light: Option<&Sheet>) -> Vec<Particle> {
        let mut lit = match self {
            Self::Given(frames) => particles::inside(&frames[frame], bounds_mm),
            Self::Carried { all, velocity, time: from } => {
                particles::advance(all, velocity, *from, time);
                *from = time;
                particles::inside(all, bounds_mm)
            }
        };
        if let Some(light) = light {
            lit.iter_mut().for_each(|particle| particle.intensity *= light.brightness(particle.place_mm.z));
            lit.retain(|particle| particle.intensity > 0.0);
        }
        lit
    }

    /// The most particles in a frame.
    pub fn most(&self) -> usize {
        match self {
            Self::Carried { all, .. } => all.len(),
            Self::Given(frames) => frames.iter().map(Vec::len).max().unwrap_or(0),
        }
    }
}
