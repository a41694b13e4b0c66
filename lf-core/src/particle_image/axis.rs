//! A lenslet along one axis: its pixels, and the places of their edges on the stop.

use super::cell_surface::REACH_SIGMA;
use super::place::Place;
use super::sensor_blur::REACH;

/// A lenslet along one axis: pixels are at `zero - slope u`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    pub(super) zero: f64,
    pub(super) slope: f64,
    pub(super) per_slope: f64,
    pub(super) kappa: f64,
    pub(super) gamma: f64,
    /// m from the lenslet's centre, mm.
    pub(super) chief: f64,
    /// The lenslet's centre, mm.
    pub(super) centre: f64,
    /// Pixels a side of the sensor.
    pub(super) pixels: usize,
}

/// Rays through the stop that meet the array within this share of the spot end at one place.
const SMALL: f64 = 1e-6;

impl Axis {
    /// First and end pixel that can be lit, for light within `reach` of the lenslet's centre, and pixels on
    /// either side of it and beyond the sensor's edges.
    #[inline(always)]
    pub(super) fn lit(
        &self,
        alpha: f64,
        half: f64,
        reach: f64,
        (beside_px, beyond_px): (f64, f64),
    ) -> Option<(i64, i64)> {
        let (low, high) = if alpha.abs() * half < 1e-9 * reach {
            if self.chief.abs() > reach { (1.0, 0.0) } else { (-half, half) }
        } else {
            let (a, b) = ((-reach - self.chief) / alpha, (reach - self.chief) / alpha);
            (a.min(b).max(-half), a.max(b).min(half))
        };
        if low >= high {
            return None;
        }
        let (a, b) = (self.zero - self.slope * low, self.zero - self.slope * high);
        let first = (a.min(b) - beside_px).floor().max(-beyond_px) as i64;
        let end = (a.max(b) + beside_px).ceil().clamp(-beyond_px, self.pixels as f64 + beyond_px) as i64;
        (first < end).then_some((first, end))
    }

    /// Like [`Self::lit`] for a blurred image: light within `corner` of the lenslet's centre, before a spot and a blur
    /// of these standard deviations, mm on the array and px, widen it together. The stop's ends are blurred alone.
    #[inline(always)]
    pub(super) fn lit_blurred(
        &self,
        alpha: f64,
        half: f64,
        corner: f64,
        (spot, blur_px): (f64, f64),
        beyond_px: f64,
    ) -> Option<(i64, i64)> {
        let (first, end) = self.lit(alpha, half, corner + REACH_SIGMA * spot, (REACH * blur_px, beyond_px))?;
        if alpha.abs() * half < SMALL * spot {
            return Some((first, end));
        }
        let per_mm = (self.slope / alpha).abs();
        let middle = self.zero + self.slope * self.chief / alpha;
        let reach = [REACH_SIGMA * spot * per_mm, REACH * blur_px];
        let beside = corner * per_mm + (reach[0] * reach[0] + reach[1] * reach[1]).sqrt();
        let (first, end) = (first.max((middle - beside).floor() as i64), end.min((middle + beside).ceil() as i64));
        (first < end).then_some((first, end))
    }

    /// The place of pixel edge `edge`. A square stop ends at `half`.
    #[inline(always)]
    pub(super) fn place(&self, edge: f64, alpha: f64, by_shift: f64, half: f64) -> Place {
        let per_slope = self.per_slope;
        let u = (self.zero - edge) * per_slope;
        if u.abs() > half {
            let u = half.copysign(u);
            return Place { u, u_by: [0.0; 3], x: self.chief + alpha * u, x_by: [1.0, u, -1.0] };
        }
        let u_by = [self.gamma * per_slope, self.gamma * u * per_slope, (by_shift - self.gamma) * per_slope];
        let along = self.kappa * per_slope;
        Place { u, u_by, x: self.chief + alpha * u, x_by: [along, u * along, alpha * u_by[2] - 1.0] }
    }
}
