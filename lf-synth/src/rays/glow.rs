//! The light that a particle sends out, and the number of rays that carry it.

use super::samples::Shape;

/// The light that a particle sends out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glow {
    /// Shape of its image in focus.
    pub shape: Shape,
    /// Standard deviation of a Gaussian, radius of a disc; at the object, mm.
    pub size_mm: f64,
    /// Number of its rays.
    pub rays: RayCount,
}

/// Number of rays that a particle sends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RayCount {
    /// The same for all particles.
    Fixed(u32),
    /// Scaled with the brightness, so that all particles have the same noise in counts.
    Scaled {
        /// Rays of a particle of `at_intensity`.
        rays: u32,
        /// Intensity, counts.
        at_intensity: f64,
    },
}

/// A scaled number of rays is clamped to 1/8..8 of the reference.
const CLAMP: f64 = 8.0;

/// Rays that leave a relative noise below 0.01: `--measure-noise` finds 0.007 to 0.009 in the ready scenes core,
/// core-round, core-hexagonal and demo, and 0.001 with the rays that the power law gives for that.
const RAYS_AT_HUNDREDTH: f64 = 15_000.0;

/// The noise falls with the number of rays to the power of 3/4.
const RAYS_PER_NOISE: f64 = 4.0 / 3.0;

impl RayCount {
    /// Rays that leave a relative noise `noise` for particles of average brightness `at_intensity`.
    pub fn for_noise(noise: f64, at_intensity: f64) -> Self {
        let rays = (RAYS_AT_HUNDREDTH * (0.01 / noise).powf(RAYS_PER_NOISE)).clamp(256.0, 2e7) as u32;
        Self::Scaled { rays, at_intensity }
    }

    /// Rays of a particle of this intensity.
    pub fn of_intensity(self, intensity: f64) -> usize {
        match self {
            Self::Fixed(rays) => rays as usize,
            Self::Scaled { rays, at_intensity } => {
                let share = (intensity / at_intensity).powf(RAYS_PER_NOISE).clamp(1.0 / CLAMP, CLAMP);
                (f64::from(rays) * share).ceil() as usize
            }
        }
    }
}
