//! How a lenslet departs from the picture that it takes: by another scale, by scales that differ along x and y, and by
//! rays that bend. The place q from the picture's middle shows what the picture has at `q + d(q)`. The light of a pixel
//! comes from a bump about `b = p + v grad log M`, of variance `v T`, `T = 1 + v grad grad log M`, where M is the mean
//! over the pixel and v the variance of the pixel and the sensor's blur, which the departure does not stretch. There,
//! with D the derivatives of d at b, the mean becomes
//!
//! ```text
//! (M + d grad M + 1/2 d d grad grad M) det(1 + D T) / det(1 + D),   d = d(b) + 1/2 v T grad grad d
//! ```
//!
//! This is exact to first order in d for a Gaussian bump. A cell that is small beside v shows at b = 0 with T = 0: it
//! moves by d(0) and changes by its area. One that is large shows at b = p with T = 1. Where the stop's rim cuts a
//! bump, only the part inside counts, by its mean and its variance ([`Cuts`]).

use super::axis::Axis;
use super::beam::{Beam, TERMS, sum_of_terms};
use super::blurred;
use super::picture_means::NUMBERS;
use super::pictures::LANES;
use crate::normal::quick_distribution;
use glam::DVec2;

/// A bump that lies farther out of the stop than this number of sigmas is cut as if it lay there.
const FARTHEST_OUT: f32 = 3.0;

/// Numbers of eight pixels along two axes.
type Eight = [[f32; LANES]; 2];

/// The departure of a lenslet from its picture, px.
pub(super) struct Departure {
    /// Share of the place along both axes.
    grows: [f32; 2],
    bend: Option<Bend>,
    stop: Stop,
    /// Whether the stop's rim cuts bumps.
    is_cut: bool,
}

/// The stop in a lenslet's image, px from the picture's middle, and half its size.
#[derive(Clone, Copy)]
pub(super) struct Stop {
    pub(super) middle: [f32; 2],
    pub(super) half: f32,
    pub(super) is_round: bool,
}

/// The bumps of eight pixels: their places, px from the picture's middle, and T along x, mixed, and along y.
pub(super) struct Bumps {
    pub(super) places: Eight,
    pub(super) widths: [[f32; LANES]; 3],
}

/// Changes of the bumps of eight pixels by the stop's rim.
struct Cuts {
    /// Motion of their means, px.
    shift: Eight,
    /// Change of the logarithm's slope there, 1/px.
    pull: Eight,
    /// Share that it takes from their variances, by rows.
    gone: [Eight; 2],
}

/// The part by rays that bend.
struct Bend {
    /// Coefficients of the bend along x and y.
    terms: [[f32; TERMS]; 2],
    /// Half apertures a pixel.
    per_px: [f32; 2],
    /// Half of v times the second derivatives along x and along y, of both parts.
    curved: [[f32; 2]; 2],
}

/// Departures of eight pixels along x and y, and their derivatives by x and by y.
struct Local {
    length: Eight,
    by: [Eight; 2],
}

impl Departure {
    /// For a lenslet at `axes`. Picture and lenslet grow by `picture` and `growths` px a mm on the array. The
    /// half aperture is in mm, the variance of the kernel in px^2.
    #[inline(always)]
    pub(super) fn new(
        beam: &Beam,
        (axes, alpha): (&[Axis; 2], DVec2),
        (growths, picture): ([f64; 2], f64),
        (half, variance): (f64, f64),
        (stop, is_cut): (Stop, bool),
    ) -> Self {
        let chief = DVec2::new(axes[0].chief, axes[1].chief);
        let slope = DVec2::new(axes[0].slope, axes[1].slope);
        let centre = DVec2::new(axes[0].centre, axes[1].centre);
        let bend = beam.rest(chief + centre, alpha, half).map(|rest| {
            // Where the middle of the picture lies in the stop.
            let (lit, side) = (-chief / alpha, DVec2::splat(half));
            let lit = if stop.is_round { lit.clamp_length_max(half) } else { lit.clamp(-side, side) };
            let second = beam.curvature(lit, half);
            let curved = |n: usize| -0.5 * picture * variance / (slope[n] * slope[n]) * second[n];
            Bend {
                terms: [0, 1].map(|n| rest.map(|term| (-picture * term[n]) as f32)),
                per_px: (-1.0 / (half * slope)).as_vec2().to_array(),
                curved: [0, 1].map(|n| curved(n).as_vec2().to_array()),
            }
        });
        let grows = growths.map(|growth| (picture / growth - 1.0) as f32);
        Self { grows, bend, stop, is_cut }
    }

    /// Its largest length on the edge of a rectangle about the picture's middle.
    #[inline(always)]
    pub(super) fn largest(&self, corner: [f32; 2]) -> f32 {
        const SIDES: Eight = [[-1.0, 0.0, 1.0, 1.0, 1.0, 0.0, -1.0, -1.0], [-1.0, -1.0, -1.0, 0.0, 1.0, 1.0, 1.0, 0.0]];
        let [x, y] = self.at(&[0, 1].map(|n| SIDES[n].map(|side| side * corner[n]))).length;
        x.iter().zip(y).map(|(x, y)| x * x + y * y).fold(0.0, f32::max).sqrt()
    }

    /// The departure at eight places.
    #[inline(always)]
    fn at(&self, [x, y]: &Eight) -> Local {
        let mut found = Local { length: [[0.0; LANES]; 2], by: [[[0.0; LANES]; 2]; 2] };
        for k in 0..LANES {
            (found.length[0][k], found.length[1][k]) = (self.grows[0] * x[k], self.grows[1] * y[k]);
            (found.by[0][0][k], found.by[1][1][k]) = (self.grows[0], self.grows[1]);
        }
        let Some(Bend { terms, per_px, .. }) = &self.bend else { return found };
        let Stop { middle, is_round, .. } = self.stop;
        for k in 0..LANES {
            let (u, v) = ((x[k] - middle[0]) * per_px[0], (y[k] - middle[1]) * per_px[1]);
            // Beside the stop rays bend as at its rim.
            let (u, v) = if is_round {
                let inwards = 1.0 / (u * u + v * v).sqrt().max(1.0);
                (u * inwards, v * inwards)
            } else {
                (u.clamp(-1.0, 1.0), v.clamp(-1.0, 1.0))
            };
            for (n, terms) in terms.iter().enumerate() {
                let (sum, [by_u, by_v]) = sum_of_terms(terms, u, v);
                found.length[n][k] += sum;
                found.by[0][n][k] += by_u * per_px[0];
                found.by[1][n][k] += by_v * per_px[1];
            }
        }
        found
    }

    /// The numbers of the means of eight pixels with these bumps, from those of the picture. `v` is the variance of the
    /// kernel.
    #[inline(always)]
    pub(super) fn follow(&self, bumps: &Bumps, means: &[[f32; LANES]; NUMBERS], v: f32) -> [[f32; LANES]; NUMBERS] {
        let mut cuts = Cuts::none();
        if self.is_cut {
            self.stop.cut(bumps, v, &mut cuts);
        }
        let mut places = bumps.places;
        for (places, shift) in places.iter_mut().zip(&cuts.shift) {
            places.iter_mut().zip(shift).for_each(|(place, shift)| *place += shift);
        }
        let Local { length: [across, down], by: [by_x, by_y] } = self.at(&places);
        let curved = if let Some(bend) = &self.bend { bend.curved } else { [[0.0; 2]; 2] };
        let (Cuts { pull, gone, .. }, mut moved) = (&cuts, [[0f32; LANES]; NUMBERS]);
        for k in 0..LANES {
            let [mean, x, y, xx, xy, yy] = [0, 1, 2, 3, 4, 5].map(|n| means[n][k]);
            let [wide_x, mixed, wide_y] = [0, 1, 2].map(|n| bumps.widths[n][k]);
            let (pull, gone) = ([pull[0][k], pull[1][k]], [0, 1].map(|n| [gone[n][0][k], gone[n][1][k]]));
            let dx = across[k] + curved[0][0] * wide_x + curved[1][0] * wide_y;
            let dy = down[k] + curved[0][1] * wide_x + curved[1][1] * wide_y;
            let (a, b, c, d) = (by_x[0][k], by_y[0][k], by_x[1][k], by_y[1][k]);
            let (a, b) = (a - a * gone[0][0] - b * gone[1][0], b - a * gone[0][1] - b * gone[1][1]);
            let (c, d) = (c - c * gone[0][0] - d * gone[1][0], d - c * gone[0][1] - d * gone[1][1]);
            // D T.
            let (ax, bx) = (a * wide_x + b * mixed, a * mixed + b * wide_y);
            let (cx, ex) = (c * wide_x + d * mixed, c * mixed + d * wide_y);
            let level = ((1.0 + ax) * (1.0 + ex) - bx * cx) / ((1.0 + a) * (1.0 + d) - b * c);
            let mean = mean + mean * (dx * pull[0] + dy * pull[1]);
            let square = dx * dx * xx + 2.0 * dx * dy * xy + dy * dy * yy;
            let (slope_x, slope_y) = (x + dx * xx + dy * xy, y + dx * xy + dy * yy);
            moved[0][k] = level * (mean + dx * x + dy * y + 0.5 * square);
            moved[1][k] = level * (slope_x + ax * slope_x + cx * slope_y);
            moved[2][k] = level * (slope_y + bx * slope_x + ex * slope_y);
            (moved[3][k], moved[4][k], moved[5][k]) = (level * xx, level * xy, level * yy);
        }
        moved
    }
}

impl Stop {
    /// Cuts bumps whose kernel has the variance `v`.
    #[inline(always)]
    fn cut(&self, Bumps { places, widths }: &Bumps, v: f32, cuts: &mut Cuts) {
        let from_middle = |k: usize| (places[0][k] - self.middle[0], places[1][k] - self.middle[1]);
        let width = |k: usize| [widths[0][k], widths[1][k], widths[2][k]];
        if self.is_round {
            for k in 0..LANES {
                let (x, y) = from_middle(k);
                let radius = (x * x + y * y).sqrt().max(f32::MIN_POSITIVE);
                cuts.add(k, [x / radius, y / radius], self.half - radius, width(k), v);
            }
        } else {
            for k in 0..LANES {
                let (x, y) = from_middle(k);
                cuts.add(k, [1f32.copysign(x), 0.0], self.half - x.abs(), width(k), v);
                cuts.add(k, [0.0, 1f32.copysign(y)], self.half - y.abs(), width(k), v);
            }
        }
    }
}

impl Cuts {
    #[inline(always)]
    fn none() -> Self {
        let none = [[0.0; LANES]; 2];
        Self { shift: none, pull: none, gone: [none; 2] }
    }

    /// Adds a straight rim to bump k, at the distance `inside` along the normal `out`.
    #[inline(always)]
    fn add(&mut self, k: usize, out: [f32; 2], inside: f32, [wide_x, mixed, wide_y]: [f32; 3], v: f32) {
        let wide = [wide_x * out[0] + mixed * out[1], mixed * out[0] + wide_y * out[1]];
        let across = (out[0] * wide[0] + out[1] * wide[1]).max(blurred::LEAST_VARIANCE as f32);
        let per_sigma = 1.0 / (v * across).sqrt();
        // The mean and the variance of a normal distribution that is cut.
        let at = (inside * per_sigma).max(-FARTHEST_OUT);
        let (share, density) = quick_distribution(at);
        let hazard = density / share;
        let (pull, gone) = (hazard * per_sigma, hazard * (at + hazard) / across);
        for n in 0..2 {
            self.shift[n][k] -= v * pull * wide[n];
            self.pull[n][k] -= pull * (wide[n] - out[n]);
            for m in 0..2 {
                self.gone[n][m][k] += gone * wide[n] * out[m];
            }
        }
    }
}
