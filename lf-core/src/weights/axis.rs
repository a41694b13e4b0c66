//! Weights along one axis of the sensor: through one lenslet, onto each pixel, and from which part of the aperture.

use super::{blur::Blur, model::Model};
use std::ops::Range;

/// The optics of one slice of voxels along one axis of the sensor. Lengths are mm unless they are called pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AxisOptics {
    pub(crate) alpha: f64,
    pub(crate) beta: f64,
    pub(crate) demagnification: f64,
    pub(crate) array_gain: f64,
    pub(crate) lenslet_gain: f64,
    pub(crate) half_aperture: f64,
    pub(crate) pixel_pitch: f64,
    pub(crate) pixels: usize,
    /// Aperture sections, for [`Model::Drt`].
    pub(crate) sections: usize,
    /// Side of the square about a section's chief ray on the sensor, pixels.
    pub(crate) square: f64,
}

/// Light through one lenslet onto one pixel, along one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Column or row.
    pub pixel: u32,
    /// Share of the light that passes the full width of the aperture, 0 to 1.
    pub weight: f32,
    /// Lower end of the part of the aperture that it comes through, mm.
    pub u0: f32,
    /// Upper end of this part, mm.
    pub u1: f32,
}

/// A cell along the axis: `[low, high]` about the lenslet's centre, and the blur of its edges.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span {
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) blur: Blur,
}

/// Shares below this are dropped; the shares of a voxel along an axis sum to 1.
const LEAST_SHARE: f64 = 1e-6;
/// Smallest slope, px per mm of the aperture.
const LEAST_SLOPE: f64 = 1e-7;

impl Span {
    /// Share of the light with its centre at `t` from the lenslet's centre that falls within.
    pub(super) fn share(&self, t: f64) -> f64 {
        self.blur.cdf(t - self.low) - self.blur.cdf(t - self.high)
    }

    /// Integral of [`Span::share`] up to `t`.
    pub(super) fn ramp(&self, t: f64) -> f64 {
        self.blur.ramp(t - self.low) - self.blur.ramp(t - self.high)
    }
}

impl AxisOptics {
    /// The part (low, high) of the aperture whose light can fall within `span`. `t0 = x_m(0) - c` is the chief ray's
    /// place from the lenslet's centre. The part is empty if low >= high.
    pub(super) fn aperture_part(&self, t0: f64, span: &Span) -> (f64, f64) {
        let (low, high) = (span.low - span.blur.reach() - t0, span.high + span.blur.reach() - t0);
        let half = self.half_aperture;
        if self.alpha.abs() * half < 1e-12 {
            return if low <= 0.0 && high > 0.0 { (-half, half) } else { (0.0, 0.0) };
        }
        let (a, b) = (low / self.alpha, high / self.alpha);
        (a.min(b).max(-half), a.max(b).min(half))
    }

    /// The pixels that [`AxisOptics::pieces`] can name, and possibly one more at either end.
    pub(crate) fn pixels_reached(&self, x0: f64, centre: f64, span: &Span) -> Range<u32> {
        let (low, high) = self.aperture_part(x0 - centre, span);
        if low >= high {
            return 0..0;
        }
        // A section's chief ray may lie half a section outside the part of the aperture from which its beam arrives.
        let section = self.half_aperture / self.sections as f64;
        let (zero, slope) = self.sensor_line(x0, centre);
        let (a, b) = (zero - slope * (high + section), zero - slope * (low - section));
        let (first, last) = (a.min(b) - 0.5 * self.square, a.max(b) + 0.5 * self.square);
        first.floor().max(0.0) as u32..last.ceil().clamp(0.0, self.pixels as f64) as u32
    }

    /// (zero, slope) of a ray's place on the sensor in pixels, `zero - slope U`: see [`crate::Optics::gains`].
    pub(super) fn sensor_line(&self, x0: f64, centre: f64) -> (f64, f64) {
        let slope = (self.demagnification - self.array_gain * self.alpha) / self.pixel_pitch;
        // If a lenslet images the point sharply, a small slope keeps it on one pixel in spite of rounding.
        let slope = if slope.abs() < LEAST_SLOPE { LEAST_SLOPE } else { slope };
        let zero = (self.lenslet_gain * centre + self.array_gain * x0) / self.pixel_pitch;
        (zero + 0.5 * self.pixels as f64, slope)
    }

    /// Appends the pieces of a voxel whose chief ray meets the array at `x0`, through the lenslet at `centre`.
    pub(crate) fn pieces(&self, model: Model, x0: f64, centre: f64, span: &Span, out: &mut Vec<Piece>) {
        match model {
            Model::Exact | Model::Sphere => self.exact(x0, centre, span, out),
            Model::Drt { .. } => self.drt(x0, centre, span, out),
        }
    }

    /// Rays are linear in U. So a pixel's share is the integral of the blurred cell over an interval of U, over D.
    fn exact(&self, x0: f64, centre: f64, span: &Span, out: &mut Vec<Piece>) {
        let t0 = x0 - centre;
        let (low, high) = self.aperture_part(t0, span);
        if low >= high {
            return;
        }
        // Find the pixels that see this part of the aperture.
        let (zero, slope) = self.sensor_line(x0, centre);
        let (a, b) = (zero - slope * high, zero - slope * low);
        let first = a.min(b).floor().max(0.0) as u32;
        let end = a.max(b).ceil().min(self.pixels as f64) as u32;
        // Integrate the blurred cell between the places in the aperture that the edges of a pixel show.
        let integral_to = |u: f64| span.ramp(t0 + self.alpha * u) / self.alpha;
        let flat = self.alpha.abs() * (high - low) < 1e-9;
        let at_edge = |pixel: u32| {
            let u = ((zero - f64::from(pixel)) / slope).clamp(low, high);
            (u, if flat { 0.0 } else { integral_to(u) })
        };
        let mut before = at_edge(first);
        for pixel in first..end {
            let after = at_edge(pixel + 1);
            // U falls as pixels rise, unless a lenslet out of focus turns its image over.
            let (lower, upper) = if slope > 0.0 { (after, before) } else { (before, after) };
            let light = if flat {
                span.share(t0 + self.alpha * 0.5 * (lower.0 + upper.0)) * (upper.0 - lower.0)
            } else {
                upper.1 - lower.1
            };
            let weight = light / (2.0 * self.half_aperture);
            if weight > LEAST_SHARE && upper.0 > lower.0 {
                let (u0, u1) = self.unblurred(t0, span, lower.0, upper.0);
                out.push(Piece { pixel, weight: weight as f32, u0: u0 as f32, u1: u1 as f32 });
            }
            before = after;
        }
    }

    /// The part of `[lower, upper]` inside the cell's sharp edges, where most of the light comes through. If there is
    /// none, the end of the interval nearer to the cell, twice.
    fn unblurred(&self, t0: f64, span: &Span, lower: f64, upper: f64) -> (f64, f64) {
        if self.alpha.abs() * self.half_aperture < 1e-12 {
            return (lower, upper);
        }
        let (a, b) = ((span.low - t0) / self.alpha, (span.high - t0) / self.alpha);
        (a.min(b).clamp(lower, upper), a.max(b).clamp(lower, upper))
    }

    /// The paper's weights w1 w2 / n: w1 is the share of a section's beam on the lenslet, w2 the share on a pixel of a
    /// square about its chief ray, and 1/n the section's share of the aperture.
    fn drt(&self, x0: f64, centre: f64, span: &Span, out: &mut Vec<Piece>) {
        let t0 = x0 - centre;
        let (low, high) = self.aperture_part(t0, span);
        if low >= high {
            return;
        }
        let n = self.sections as f64;
        let width = 2.0 * self.half_aperture / n;
        let first = ((low + self.half_aperture) / width).floor().max(0.0) as usize;
        let last = (((high + self.half_aperture) / width).ceil() as usize).min(self.sections);
        for section in first..last {
            // Compute the share of the section's beam on the lenslet.
            let u = -self.half_aperture + (section as f64 + 0.5) * width;
            let (beam, t) = (self.alpha * width, t0 + self.alpha * u);
            let w1 = if beam.abs() < 1e-9 {
                span.share(t)
            } else {
                (span.ramp(t + 0.5 * beam) - span.ramp(t - 0.5 * beam)) / beam
            };
            if w1 <= LEAST_SHARE {
                continue;
            }
            // Share the square about the chief ray out over the pixels.
            let (zero, slope) = self.sensor_line(x0, centre);
            let left = zero - slope * u - 0.5 * self.square;
            let part = left - left.floor();
            let mut step = 0.0;
            while part + (self.square - step) > 0.0 {
                let pixel = left.floor() + step;
                let w2 = ((part + (self.square - step)).min(1.0) - (part - step).max(0.0)) / self.square;
                let weight = w1 * w2 / n;
                if pixel >= 0.0 && pixel < self.pixels as f64 && weight > LEAST_SHARE {
                    out.push(Piece { pixel: pixel as u32, weight: weight as f32, u0: u as f32, u1: u as f32 });
                }
                step += 1.0;
            }
        }
    }
}
