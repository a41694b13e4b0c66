//! The blur of a sensor: how it widens the spot of a particle, and how much of a bump lies on one side of an edge.

use crate::normal::{density, distribution};
use crate::{Camera, halo::Halo};
use glam::DVec4;

/// Blur of a camera, as the images of particles see it.
#[derive(Debug, Clone)]
pub(super) struct SensorBlur {
    /// Standard deviation of its Gaussian, px.
    pub(super) sigma_px: f64,
    /// Share of the light that the Gaussian stands for; the rest is in the halo.
    pub(super) share: f64,
    pub(super) halo: Option<Halo>,
    pub(super) bell: Bell,
}

/// How the blur widens a particle's spot on the array.
#[derive(Debug, Clone, Copy)]
pub(super) struct Widened {
    /// Standard deviation of spot and blur together, mm.
    pub(super) sigma_mm: f64,
    /// Its derivatives by the spot's own size, by alpha, mm, and by the blur, mm/px.
    pub(super) by_spot: f64,
    pub(super) by_alpha: f64,
    pub(super) by_blur: f64,
    /// Whether the pixel is so small on the array that it counts as a part of the Gaussian.
    pub(super) has_pixel: bool,
}

/// Light farther from the sharp image than this many standard deviations of the blur is left out: 0.1 % on a side.
pub(super) const REACH: f64 = 3.0;
/// Variance of a pixel, px^2.
pub(super) const PIXEL_VARIANCE: f64 = 1.0 / 12.0;
/// A pixel below this width on the array, in standard deviations of the spot, counts as a part of the Gaussian.
const SMALL: f64 = 0.5;
impl SensorBlur {
    /// None for a sharp camera.
    pub(super) fn new(camera: &Camera) -> Option<Self> {
        let sigma_px = camera.blur_core_px();
        (sigma_px > 0.0).then(|| {
            let halo = Halo::new(camera);
            let share = halo.as_ref().map_or(1.0, Halo::middle_share);
            Self { sigma_px, share, halo, bell: Bell::new() }
        })
    }

    /// Pixels beyond a sharp image that light reaches.
    #[inline(always)]
    pub(super) fn reach_px(&self) -> f64 {
        REACH * self.sigma_px
    }

    /// Variance of the pixel and the blur together, px^2.
    #[inline(always)]
    pub(super) fn kernel_px2(&self) -> f64 {
        PIXEL_VARIANCE + self.sigma_px * self.sigma_px
    }

    /// The spot of a particle on the array, widened by the blur. `px_by_stop` is how many pixels a millimetre of the
    /// stop covers.
    #[inline(always)]
    pub(super) fn widened(&self, spot_mm: f64, alpha: f64, px_by_stop: f64) -> Widened {
        let pixel_mm = 1.0 / px_by_stop.abs();
        let along = (alpha * pixel_mm).abs();
        let mut variance_px = self.sigma_px * self.sigma_px;
        let blur_mm = along * self.sigma_px;
        let has_pixel = along < SMALL * (spot_mm * spot_mm + blur_mm * blur_mm).sqrt();
        if has_pixel {
            variance_px += PIXEL_VARIANCE;
        }
        let sigma_mm = (spot_mm * spot_mm + along * along * variance_px).sqrt();
        Widened {
            sigma_mm,
            by_spot: spot_mm / sigma_mm,
            by_alpha: alpha * pixel_mm * pixel_mm * variance_px / sigma_mm,
            by_blur: along * along * self.sigma_px / sigma_mm,
            has_pixel,
        }
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

    /// Distribution and density of four places; 0 far below 0.
    #[inline(always)]
    pub(super) fn four(&self, z: DVec4) -> (DVec4, DVec4) {
        let at = |z: f64| self.at(z).unwrap_or_default();
        let [a, b, c, d] = [at(z.x), at(z.y), at(z.z), at(z.w)];
        (DVec4::new(a.0, b.0, c.0, d.0), DVec4::new(a.1, b.1, c.1, d.1))
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
