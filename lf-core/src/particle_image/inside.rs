//! How much of a normal bump lies inside the stop. Lengths are in any unit, from the stop's middle.

use super::pictures::LANES;
use crate::normal::quick_distribution;

/// The variance of the bump is no less than this share of that of K.
pub(super) const LEAST_VARIANCE: f32 = 0.05;

/// Numbers of eight places.
pub(super) type Eight = [f32; LANES];

/// How a stop cuts bumps.
#[derive(Debug, Clone, Copy)]
pub(super) enum StopRim {
    /// It cuts nothing.
    Far,
    /// A round stop. Its variance across the rim is at least this.
    Round(f32),
    Square,
}

/// The shares of eight bumps, and their derivatives by the bumps' middles and by the stop's half side.
pub(super) struct Passed {
    pub(super) share: Eight,
    pub(super) by_middle: [Eight; 2],
    pub(super) by_half: Eight,
}

impl StopRim {
    /// The rim of a round or a square stop, for blur of this variance.
    #[inline(always)]
    pub(super) fn new(cuts_nothing: bool, is_round: bool, variance: f32) -> Self {
        match (cuts_nothing, is_round) {
            (true, _) => Self::Far,
            (_, true) => Self::Round(LEAST_VARIANCE * variance),
            (_, false) => Self::Square,
        }
    }

    /// The shares of bumps with these middles and variances: along x, mixed, and along y.
    #[inline(always)]
    pub(super) fn passed(self, half: f32, [u, v]: &[Eight; 2], [along_x, mixed, along_y]: &[Eight; 3]) -> Passed {
        let none = [0f32; LANES];
        let mut passed = Passed { share: [1.0; LANES], by_middle: [none; 2], by_half: none };
        match self {
            Self::Far => {}
            Self::Round(least) => {
                for k in 0..LANES {
                    passed.set(k, in_round(half, [u[k], v[k]], [along_x[k], along_y[k]], mixed[k], least));
                }
            }
            Self::Square => {
                for k in 0..LANES {
                    passed.set(k, in_square(half, [u[k], v[k]], [along_x[k], along_y[k]]));
                }
            }
        }
        passed
    }
}

impl Passed {
    #[inline(always)]
    fn set(&mut self, k: usize, (share, [by_u, by_v], by_half): Inside) {
        (self.share[k], self.by_middle[0][k], self.by_middle[1][k], self.by_half[k]) = (share, by_u, by_v, by_half);
    }
}

/// The share, and its derivatives by the bump's middle and by the stop's half side.
type Inside = (f32, [f32; 2], f32);

/// A round stop. Its rim is a parabola near the bump: it leaves out what the bump's width along the rim bends away. The
/// variance across the rim is at least `least`.
#[inline(always)]
fn in_round(half: f32, [u, v]: [f32; 2], variance: [f32; 2], mixed: f32, least: f32) -> Inside {
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
fn in_square(half: f32, [u, v]: [f32; 2], variance: [f32; 2]) -> Inside {
    let side = |u: f32, variance: f32| {
        let per_sigma = 1.0 / variance.sqrt();
        let (share, density) = quick_distribution((half - u.abs()) * per_sigma);
        (share, density * per_sigma, u.signum())
    };
    let ((x, by_x, x_sign), (y, by_y, y_sign)) = (side(u, variance[0]), side(v, variance[1]));
    (x * y, [-by_x * y * x_sign, -by_y * x * y_sign], by_x * y + by_y * x)
}
