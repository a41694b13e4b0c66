//! Places along one axis of a lenslet's image: in the stop and on the array, with derivatives.

/// A place along one axis where the tables are read: an edge of a pixel, or a point within it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Place {
    /// Place in the stop, mm, and its derivatives by m, alpha and the lattice's shift.
    pub(super) u: f64,
    pub(super) u_by: [f64; 3],
    /// Place on the array from the lenslet's centre, mm, and its derivatives by the same.
    pub(super) x: f64,
    pub(super) x_by: [f64; 3],
}

impl Place {
    /// Derivatives of the place on the array of a ray whose hit moves by `bend` more for each length of the stop.
    #[inline(always)]
    pub(super) fn x_by_of_ray(&self, bend: f64) -> [f64; 3] {
        let ([m, alpha, shift], [u_m, u_alpha, u_shift]) = (self.x_by, self.u_by);
        [m + bend * u_m, alpha + bend * u_alpha, shift + bend * u_shift]
    }

    /// Between two places.
    #[inline(always)]
    pub(super) fn between(a: &Self, b: &Self, part: f64) -> Self {
        let mix = |a: f64, b: f64| a + part * (b - a);
        let mixed = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|n| mix(a[n], b[n]));
        Self { u: mix(a.u, b.u), u_by: mixed(a.u_by, b.u_by), x: mix(a.x, b.x), x_by: mixed(a.x_by, b.x_by) }
    }
}

/// The width in the stop between two edges, mm, and its derivatives by m, alpha and the lattice's shift.
#[inline(always)]
pub(super) fn width(edges: &[Place]) -> (f64, [f64; 3]) {
    let width = edges[0].u - edges[1].u;
    let sign = 1f64.copysign(width);
    (width.abs().max(f64::MIN_POSITIVE), std::array::from_fn(|n| sign * (edges[0].u_by[n] - edges[1].u_by[n])))
}
