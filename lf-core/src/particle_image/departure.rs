//! How a lenslet departs from the picture that it takes: by another scale, and by scales that differ along x and y. The
//! place q from the picture's middle shows what the picture has at `q + d(q)`. The light of a pixel comes from a bump
//! about `b = p + v grad log M`, of variance `v T`, `T = 1 + v grad grad log M`. Here M is the mean over the pixel, and
//! v the variance of the pixel and the sensor's blur, which the departure does not stretch. With D the derivatives of
//! d, the mean becomes
//!
//! ```text
//! (M + d grad M + 1/2 d d grad grad M) det(1 + D T) / det(1 + D),   d = d(b)
//! ```
//!
//! This is exact to first order in d for a Gaussian bump. A cell that is small beside v shows at b = 0 with T = 0: it
//! moves by d(0) and changes by its area. One that is large shows at b = p with T = 1. Where the stop's rim cuts a
//! bump, only the part inside counts, by its mean and its variance ([`Cuts`]).

use super::inside::LEAST_VARIANCE;
use super::picture_means::NUMBERS;
use super::pictures::LANES;
use crate::normal::quick_distribution;

/// A bump that lies farther out of the stop than this number of sigmas is cut as if it lay there.
const FARTHEST_OUT: f32 = 3.0;

/// Numbers of eight pixels along two axes.
type Eight = [[f32; LANES]; 2];

/// The departure of a lenslet from its picture, px.
pub(super) struct Departure {
    /// Share of the place along both axes.
    grows: [f32; 2],
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

impl Departure {
    /// For a lenslet whose picture grows by `growths` px a mm on the array, where the picture that it takes grows by
    /// `picture`.
    #[inline(always)]
    pub(super) fn new(growths: [f64; 2], picture: f64, (stop, is_cut): (Stop, bool)) -> Self {
        Self { grows: growths.map(|growth| (picture / growth - 1.0) as f32), stop, is_cut }
    }

    /// Its largest length on the edge of a rectangle about the picture's middle.
    #[inline(always)]
    pub(super) fn largest(&self, corner: [f32; 2]) -> f32 {
        (self.grows[0] * corner[0]).hypot(self.grows[1] * corner[1])
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
        let (Cuts { pull, gone, .. }, mut moved) = (&cuts, [[0f32; LANES]; NUMBERS]);
        for k in 0..LANES {
            let [mean, x, y, xx, xy, yy] = [0, 1, 2, 3, 4, 5].map(|n| means[n][k]);
            let [wide_x, mixed, wide_y] = [0, 1, 2].map(|n| bumps.widths[n][k]);
            let (pull, gone) = ([pull[0][k], pull[1][k]], [0, 1].map(|n| [gone[n][0][k], gone[n][1][k]]));
            let [grows_x, grows_y] = self.grows;
            let (dx, dy) = (grows_x * places[0][k], grows_y * places[1][k]);
            let (a, b) = (grows_x - grows_x * gone[0][0], -grows_x * gone[0][1]);
            let (c, d) = (-grows_y * gone[1][0], grows_y - grows_y * gone[1][1]);
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
        let across = (out[0] * wide[0] + out[1] * wide[1]).max(LEAST_VARIANCE);
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
