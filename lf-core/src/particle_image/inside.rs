//! How much of a normal bump lies inside the stop. Lengths are in any unit, from the stop's middle.

use crate::normal::quick_distribution;

/// The share, and its derivatives by the bump's middle and by the stop's half side.
pub(super) type Inside = (f32, [f32; 2], f32);

/// A round stop. Its rim is a parabola near the bump: it leaves out what the bump's width along the rim bends away. The
/// variance across the rim is at least `least`.
#[inline(always)]
pub(super) fn in_round(half: f32, [u, v]: [f32; 2], variance: [f32; 2], mixed: f32, least: f32) -> Inside {
    let radius = (u * u + v * v).sqrt().max(f32::MIN_POSITIVE);
    let out = [u / radius, v / radius];
    let square = [out[0] * out[0], out[1] * out[1]];
    let cross = 2.0 * out[0] * out[1] * mixed;
    let across = (square[0] * variance[0] + square[1] * variance[1] + cross).max(least);
    let along = (square[1] * variance[0] + square[0] * variance[1] - cross).max(0.0);
    let per_sigma = 1.0 / across.sqrt();
    let (share, density) = quick_distribution((half - radius - 0.5 * along / half) * per_sigma);
    let by = density * per_sigma;
    (share, [-by * out[0], -by * out[1]], by)
}

/// A square stop.
#[inline(always)]
pub(super) fn in_square(half: f32, [u, v]: [f32; 2], variance: [f32; 2]) -> Inside {
    let side = |u: f32, variance: f32| {
        let per_sigma = 1.0 / variance.sqrt();
        let (share, density) = quick_distribution((half - u.abs()) * per_sigma);
        (share, density * per_sigma, u.signum())
    };
    let ((x, by_x, x_sign), (y, by_y, y_sign)) = (side(u, variance[0]), side(v, variance[1]));
    (x * y, [-by_x * y * x_sign, -by_y * x * y_sign], by_x * y + by_y * x)
}
