//! What a stop leaves of a lenslet's image of a voxel, four columns at a time.

use super::disc::OUTER_NODE;
use glam::Vec4;

/// Parts of the aperture behind four columns: from, to, and 1 over the width.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parts {
    u0: Vec4,
    u1: Vec4,
    per_width: Vec4,
}

/// A part of no width is given this one, mm: it is outside.
const LEAST_WIDTH: Vec4 = Vec4::splat(1e-20);

/// Along one axis: the aperture behind a pixel's edge n is `(zero - n) per_slope`, and the cell lets through `low..high`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub(super) zero: f32,
    pub(super) per_slope: f32,
    pub(super) low: f32,
    pub(super) high: f32,
}

impl Line {
    /// The parts behind four pixels that the cell lets through; all of them where the cell lets none through but what its
    /// blurred edge does.
    #[inline(always)]
    pub(super) fn parts(&self, first: i32) -> Parts {
        let edges = Vec4::splat(self.zero - first as f32) - Vec4::new(0.0, 1.0, 2.0, 3.0);
        let (a, b) = (edges * self.per_slope, (edges - 1.0) * self.per_slope);
        let (lower, upper) = (a.min(b), a.max(b));
        let (u0, u1) = (lower.max(Vec4::splat(self.low)), upper.min(Vec4::splat(self.high)));
        let is_within = u0.cmplt(u1);
        let (u0, u1) = (Vec4::select(is_within, u0, lower), Vec4::select(is_within, u1, upper));
        Parts { u0, u1, per_width: (u1 - u0).max(LEAST_WIDTH).recip() }
    }
}

impl Parts {
    /// Their middles.
    #[inline(always)]
    pub(super) fn middles(&self) -> Vec4 {
        0.5 * (self.u0 + self.u1)
    }

    /// Shares within `half` of the middle.
    #[inline(always)]
    pub(super) fn within(&self, half: f32) -> Vec4 {
        let inside = self.u1.min(Vec4::splat(half)) - self.u0.max(Vec4::splat(-half));
        inside.max(Vec4::ZERO) * self.per_width
    }

    /// Shares within the half chords of a round stop.
    #[inline(always)]
    pub(super) fn within_chords(&self, [a, b, c]: [f32; 3]) -> Vec4 {
        (5.0 * (self.within(a) + self.within(c)) + 8.0 * self.within(b)) * (1.0 / 18.0)
    }

    /// Half chords of a round stop at the nodes of four rows' parts, as [`super::Chords`] has them.
    #[inline(always)]
    pub(super) fn half_chords(&self, radius: f32) -> [Vec4; 3] {
        let (middle, reach) = (0.5 * (self.u0 + self.u1), 0.5 * (self.u1 - self.u0));
        [-OUTER_NODE as f32, 0.0, OUTER_NODE as f32].map(|node| {
            let v = middle + node * reach;
            let square = (Vec4::splat(radius * radius) - v * v).max(Vec4::ZERO);
            // Four roots at once; glam has none.
            Vec4::new(square.x.sqrt(), square.y.sqrt(), square.z.sqrt(), square.w.sqrt())
        })
    }
}
