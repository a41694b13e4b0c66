//! The mean of a cell over pixels, four of a row at once.

use super::place::Place;
use glam::DVec4;

/// Pixels that are computed at once.
pub(super) const LANES: usize = 4;
/// Numbers of a mean, and those without the derivatives of slopes and curvatures by the size.
pub(super) const NUMBERS: usize = 12;
pub(super) const PLAIN: usize = 7;

/// Means of the cell's share over four pixels and the blur, with their derivatives by the place on the array and by the
/// size of the spot: the numbers of [`super::spline::Jet`], each for four pixels.
pub(super) type Mean = [[f64; LANES]; NUMBERS];

/// Four places along x.
#[derive(Debug, Clone, Copy)]
pub(super) struct FourPlaces {
    pub(super) u: DVec4,
    pub(super) u_by: [DVec4; 3],
    pub(super) x_by: [DVec4; 3],
}

impl FourPlaces {
    /// The places from `first` on; the last one is repeated.
    #[inline(always)]
    pub(super) fn new(places: &[Place], first: usize) -> Self {
        let four = [0, 1, 2, 3].map(|k| &places[(first + k).min(places.len() - 1)]);
        let [a, b, c, d] = four;
        let u_by = |n: usize| DVec4::new(a.u_by[n], b.u_by[n], c.u_by[n], d.u_by[n]);
        let x_by = |n: usize| DVec4::new(a.x_by[n], b.x_by[n], c.x_by[n], d.x_by[n]);
        Self { u: DVec4::new(a.u, b.u, c.u, d.u), u_by: [u_by(0), u_by(1), u_by(2)], x_by: [x_by(0), x_by(1), x_by(2)] }
    }
}
