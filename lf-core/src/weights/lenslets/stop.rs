//! The part of a lenslet's image of a voxel that the stop lets through, four pixels at a time.

use crate::weights::chords::OUTER_NODE;
use glam::Vec4;

/// Spans of the aperture behind four pixels along one axis: from, to, and 1 over the width.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spans {
    u0: Vec4,
    u1: Vec4,
    per_width: Vec4,
}

/// Width given to an empty span, mm; the span then counts as outside.
const LEAST_WIDTH: Vec4 = Vec4::splat(1e-20);

/// The aperture behind the pixels along one axis. The edge of pixel n looks at `(zero - n) per_slope`, and the cell
/// lets `low..high` through.
#[derive(Debug, Clone, Copy)]
pub(super) struct ApertureBehind {
    pub(super) zero: f32,
    pub(super) per_slope: f32,
    pub(super) low: f32,
    pub(super) high: f32,
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
