//! The blur of a sensor: how it widens the spot of a particle, and how much of a bump lies on one side of an edge.

use super::fine_sensor::FineSensor;
use crate::normal::{density, distribution};
use crate::{Camera, halo::Halo};

/// Blur of a camera, as the images of particles see it.
#[derive(Debug, Clone)]
pub(super) struct SensorBlur {
    /// Standard deviation of its Gaussian, px.
    pub(super) sigma_px: f64,
    /// Share of the light that the images of particles hold; the rest is in the halo.
    pub(super) share: f64,
    pub(super) halo: Option<Halo>,
    pub(super) bell: Bell,
    pub(super) fine: FineSensor,
    /// lambda g / p where waves are followed, px; else 0.
    unit_px: f64,
    /// Standard deviation of the part of the Gaussian that widens the light of a place in the stop, px: where waves are
    /// followed, the middle of the pattern is not a part of it.
    pub(super) own_px: f64,
}

/// In waves, the edge of a stop lies this far inside, in lambda g / p: coherent light has a quarter of its intensity at
/// an edge, and not a half. A Gaussian edge there has the least squared error against knife edges before square cells.
const RIM: f64 = 0.14;
/// Images in waves have all light up to about this distance from a sharp image, lambda g / p: 8 beside a cell's shadow.
const BEYOND_WAVES: f64 = 14.0;
/// Light farther from the sharp image than this many standard deviations of the blur is left out: 0.1 % on a side.
pub(super) const REACH: f64 = 3.0;
/// Variance of a pixel, px^2.
pub(super) const PIXEL_VARIANCE: f64 = 1.0 / 12.0;

impl SensorBlur {
    /// None for a sharp camera.
    pub(super) fn new(camera: &Camera) -> Option<Self> {
        let sigma_px = camera.blur_core_px();
        (sigma_px > 0.0).then(|| {
            let waves = camera.fresnel();
            let halo = if waves.is_some() { Halo::beyond(camera, BEYOND_WAVES) } else { Halo::new(camera) };
            let share = halo.as_ref().map_or(1.0, Halo::middle_share);
            let unit_px = waves.map_or(0.0, |pattern| pattern.unit_px);
            let gaussian_px = camera.blur.map_or(0.0, |blur| blur.sigma_px);
            let own_px = if waves.is_some() { gaussian_px } else { sigma_px };
            let kernel_px2 = PIXEL_VARIANCE + own_px * own_px;
            let fine = if waves.is_some() { FineSensor::whole(kernel_px2) } else { FineSensor::new(sigma_px) };
            Self { sigma_px, share, halo, bell: Bell::new(), fine, unit_px, own_px }
        })
    }

    /// Pixels beyond a sharp image that light reaches.
    #[inline(always)]
    pub(super) fn reach_px(&self) -> f64 {
        REACH * self.sigma_px
    }

    /// Variance of the pixel and of the blur that widens the light of a place in the stop, px^2.
    #[inline(always)]
    pub(super) fn kernel_px2(&self) -> f64 {
        PIXEL_VARIANCE + self.own_px * self.own_px
    }

    /// Variance of the rest of the Gaussian, px^2.
    #[inline(always)]
    pub(super) fn middle_px2(&self) -> f64 {
        self.sigma_px * self.sigma_px - self.own_px * self.own_px
    }

    /// How far inside the stop its rim lies in a lenslet's image, px.
    #[inline(always)]
    pub(super) fn rim_px(&self) -> f64 {
        RIM * self.unit_px
    }
}

/// The normal distribution as a table: a cubic a step.
#[derive(Debug, Clone)]
pub(super) struct Bell(Vec<[f64; 4]>);

/// Range and nodes of the table.
const BELL_REACH: f64 = 5.0;
const BELL_STEPS: f64 = 32.0;

impl Bell {
    fn new() -> Self {
        let count = (2.0 * BELL_REACH * BELL_STEPS) as usize;
        let at = |n: usize| n as f64 / BELL_STEPS - BELL_REACH;
        let ends: Vec<[f64; 2]> = (0..=count + 1).map(|n| [distribution(at(n)), density(at(n)) / BELL_STEPS]).collect();
        let cubic = |ends: &[[f64; 2]]| {
            let ([a, da], [b, db]) = (ends[0], ends[1]);
            [a, da, 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db]
        };
        Self(ends.windows(2).map(cubic).collect())
    }

    /// Distribution and density; None far below 0. By cubics, to 1e-8.
    #[inline(always)]
    pub(super) fn at(&self, z: f64) -> Option<(f64, f64)> {
        if z >= BELL_REACH {
            return Some((1.0, 0.0));
        }
        let place = (z + BELL_REACH) * BELL_STEPS;
        if place <= 0.0 {
            return None;
        }
        let n = place as usize;
        let t = place - n as f64;
        let [a, b, c, d] = self.0[n];
        Some((a + t * (b + t * (c + t * d)), BELL_STEPS * (b + t * (2.0 * c + 3.0 * t * d))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_normal_distribution() {
        let bell = Bell::new();
        for n in 0..998 {
            let z = -4.99 + 0.01 * f64::from(n);
            let (share, slope) = bell.at(z).unwrap_or_default();
            assert!((share - distribution(z)).abs() < 1e-7 && (slope - density(z)).abs() < 3e-5, "{z}");
        }
        assert!(bell.at(-5.1).is_none());
        assert_eq!(bell.at(7.0), Some((1.0, 0.0)));
    }
}
