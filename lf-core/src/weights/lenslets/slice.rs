//! The optics of one slice, as a lenslet's image of a voxel needs them: the aperture behind its pixels.

use crate::weights::{axis::AxisOptics, blur::Blur, chords::OUTER_NODE, geometry::Geometry};
use glam::{DVec2, Vec4};

/// Smallest step, as a fraction of the voxel's footprint on the array; nearer focus counts as focus.
const LEAST_STEP: f64 = 1.0 / 1536.0;
/// Largest step in the same unit: a voxel's image is then a point.
const LARGEST_STEP: f64 = 1e6;
/// Width given to an empty span, mm; the span then counts as outside.
const LEAST_WIDTH: Vec4 = Vec4::splat(1e-20);

#[derive(Debug, Clone, Copy)]
pub(super) struct SliceOptics {
    pub(super) z: usize,
    pub(super) axis: AxisOptics,
    /// Change of the place on the array from one pixel's edge to the next, mm; never 0.
    pub(super) step_mm: f64,
    /// px per mm of aperture, with the sign of [`AxisOptics::sensor_line`].
    slope: f64,
    pub(super) per_slope: f64,
    per_alpha: f64,
    /// Half the stop, mm.
    pub(super) half: f32,
    /// Half the beam of the stop on the array, mm.
    pub(super) spread: f64,
    /// 1 / (width of a pixel), 1/mm.
    pub(super) per_pixel: f64,
    /// The middle of a patch, px per mm of the chief ray's place and of the lenslet's centre.
    pub(super) by_chief: f64,
    pub(super) by_centre: f64,
    /// Half sides of the cell and of the blurred cell, mm.
    pub(super) corner: DVec2,
    pub(super) reach: DVec2,
    /// From mm^2 of the array to the share of the light.
    pub(super) scale: f32,
}

impl SliceOptics {
    pub(super) fn new(geometry: &Geometry, z: usize) -> Self {
        let axis = geometry.axis(z, 0);
        let (_, slope) = axis.sensor_line(0.0, 0.0);
        let corner = geometry.corner();
        let reach = corner + DVec2::from(geometry.blurs(&axis).map(Blur::reach));
        let size_mm = 2.0 * reach.max_element();
        let step_mm = (axis.alpha / slope).abs().clamp(LEAST_STEP * size_mm, LARGEST_STEP * size_mm);
        // The alpha that belongs to this step: not 0 even in focus, with the sign of the true one.
        let alpha = (step_mm * slope.abs()).copysign(axis.alpha);
        let axis = AxisOptics { alpha, ..axis };
        let per_pixel = 1.0 / axis.pixel_pitch;
        let whole = 2.0 * axis.half_aperture * alpha;
        Self {
            z,
            step_mm,
            slope,
            per_slope: 1.0 / slope,
            per_alpha: 1.0 / alpha,
            half: axis.half_aperture as f32,
            per_pixel,
            spread: alpha.abs() * axis.half_aperture,
            by_chief: axis.array_gain * per_pixel + slope / alpha,
            by_centre: axis.lenslet_gain * per_pixel - slope / alpha,
            corner,
            reach,
            scale: geometry.scale / (whole * whole) as f32,
            axis,
        }
    }

    /// The aperture behind pixels along one axis, for a cell `[low, high]`. `zero` is the pixel edge that U = 0 meets
    /// and `beyond` the chief ray's place from the lenslet's centre.
    #[inline(always)]
    pub(super) fn aperture_behind(&self, zero: f64, beyond: f64, cell: [f64; 2], per_slope: f64) -> ApertureBehind {
        let [a, b] = cell.map(|edge| (edge - beyond) * self.per_alpha);
        ApertureBehind { zero: zero as f32, per_slope: per_slope as f32, low: a.min(b) as f32, high: a.max(b) as f32 }
    }

    /// First and end pixel of the stop's image, for pixels cut into `per_px` parts.
    #[inline(always)]
    pub(super) fn stop_pixels(&self, zero: f64, per_px: f64) -> (i32, i32) {
        let half = per_px * self.slope.abs() * self.axis.half_aperture;
        ((zero - half).floor() as i32, (zero + half).floor() as i32 + 1)
    }
}

/// Spans of the aperture behind four pixels along one axis: from, to, and 1 over the width.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spans {
    u0: Vec4,
    u1: Vec4,
    per_width: Vec4,
}

/// The aperture behind the pixels along one axis. The edge of pixel n looks at `(zero - n) per_slope`, and the cell
/// lets `low..high` through.
#[derive(Debug, Clone, Copy)]
pub(super) struct ApertureBehind {
    zero: f32,
    per_slope: f32,
    low: f32,
    high: f32,
}

impl ApertureBehind {
    /// The spans behind four pixels that the cell lets through. If the cell lets nothing of a pixel through, its light
    /// comes over the cell's blurred edge: then the span is the pixel's whole part of the aperture.
    #[inline(always)]
    pub(super) fn spans(&self, first: i32) -> Spans {
        let edges = Vec4::splat(self.zero - first as f32) - Vec4::new(0.0, 1.0, 2.0, 3.0);
        let (a, b) = (edges * self.per_slope, (edges - 1.0) * self.per_slope);
        let (lower, upper) = (a.min(b), a.max(b));
        let (u0, u1) = (lower.max(Vec4::splat(self.low)), upper.min(Vec4::splat(self.high)));
        let is_within = u0.cmplt(u1);
        let (u0, u1) = (Vec4::select(is_within, u0, lower), Vec4::select(is_within, u1, upper));
        Spans { u0, u1, per_width: (u1 - u0).max(LEAST_WIDTH).recip() }
    }
}

impl Spans {
    /// Their middles.
    #[inline(always)]
    pub(super) fn middles(&self) -> Vec4 {
        0.5 * (self.u0 + self.u1)
    }

    /// Shares of the spans within `half` of the middle of the aperture.
    #[inline(always)]
    pub(super) fn within(&self, half: f32) -> Vec4 {
        let inside = self.u1.min(Vec4::splat(half)) - self.u0.max(Vec4::splat(-half));
        inside.max(Vec4::ZERO) * self.per_width
    }

    /// Shares of the spans within the half chords of a round stop, by Gauss-Legendre quadrature.
    #[inline(always)]
    pub(super) fn within_chords(&self, [a, b, c]: [f32; 3]) -> Vec4 {
        (5.0 * (self.within(a) + self.within(c)) + 8.0 * self.within(b)) * (1.0 / 18.0)
    }

    /// Half chords of a round stop at the three nodes of each span; see [`crate::weights::Chords::nodes`].
    #[inline(always)]
    pub(super) fn half_chords(&self, radius: f32) -> [Vec4; 3] {
        let (middle, reach) = (0.5 * (self.u0 + self.u1), 0.5 * (self.u1 - self.u0));
        [-OUTER_NODE as f32, 0.0, OUTER_NODE as f32].map(|node| {
            let v = middle + node * reach;
            let square = (Vec4::splat(radius * radius) - v * v).max(Vec4::ZERO);
            // Compilers take four roots at once here; glam has no such function.
            Vec4::new(square.x.sqrt(), square.y.sqrt(), square.z.sqrt(), square.w.sqrt())
        })
    }
}
