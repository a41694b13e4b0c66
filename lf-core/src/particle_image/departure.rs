//! How a lenslet departs from the picture that it takes: by another scale, by scales that differ along x and y, and by
//! rays that bend. A pixel at the place q from the picture's middle shows what the picture has at `q + d(q)`, where
//! `d = D q + r`, D a matrix of 2 x 2 and r what is not linear. A mean M becomes
//!
//! ```text
//! (M + tr D M + d grad M + v D grad grad M + 1/2 S grad grad M) / det(1 + D),   S = w^2 d d + (1 - w^2) r r
//! ```
//!
//! where v is the variance of the pixel and the sensor's blur, which the departure does not stretch. The first order is
//! exact. A cell that is small beside v only changes the level, by its area; `w = c / (c + v)`, where c is the variance
//! of the cell and its spot, takes the second order from it, as is right for a Gaussian cell.

use super::axis::Axis;
use super::beam::{Beam, TERMS, sum_of_terms};
use super::picture_means::{NUMBERS, PictureMeans};
use super::pictures::LANES;
use glam::DVec2;

/// Numbers of eight pixels along two axes.
type Eight = [[f32; LANES]; 2];

/// The departure of a lenslet from its picture, px.
pub(super) struct Departure {
    /// Share of the place along both axes.
    grows: [f32; 2],
    bend: Option<Bend>,
    /// D, its trace, and the inverse of the determinant.
    linear: [[f32; 2]; 2],
    trace: f32,
    per_area: f32,
    /// v and w.
    variance: f32,
    share: f32,
}

/// The part by rays that bend.
struct Bend {
    /// Coefficients of the bend along x and y.
    terms: [[f32; TERMS]; 2],
    /// The stop's middle from the picture's, px, and half apertures a pixel.
    stop: [f32; 2],
    per_px: [f32; 2],
    is_round: bool,
    /// The mean over a pixel of what is not linear.
    curved: [f32; 2],
}

impl Departure {
    /// For a lenslet at `axes`. Picture and lenslet grow by `picture` and `growths` px a mm on the array. The picture's
    /// middle is at `middle` px; `variances` are v and c, px^2.
    #[inline(always)]
    pub(super) fn new(
        beam: &Beam,
        (axes, alpha): (&[Axis; 2], DVec2),
        (growths, picture): ([f64; 2], f64),
        (middle, variances): ([f64; 2], [f64; 2]),
        (half, is_round): (f64, bool),
    ) -> Self {
        let chief = DVec2::new(axes[0].chief, axes[1].chief);
        let slope = DVec2::new(axes[0].slope, axes[1].slope);
        // Where the middle of the picture lies in the stop.
        let lit = -chief / alpha;
        let lit =
            if is_round { lit.clamp_length_max(half) } else { lit.clamp(DVec2::splat(-half), DVec2::splat(half)) };
        let [by_u, by_v] = beam.slopes(lit, half).map(|by| picture * by);
        let centre = DVec2::new(axes[0].centre, axes[1].centre);
        let bend = beam.rest(chief + centre, alpha, half).map(|rest| {
            let [across, down] = beam.curvature(lit, half);
            let curved = -0.5 * picture * variances[0] * (across / (slope.x * slope.x) + down / (slope.y * slope.y));
            Bend {
                terms: [0, 1].map(|n| rest.map(|term| (-picture * term[n]) as f32)),
                stop: [0, 1].map(|n| (axes[n].zero - middle[n]) as f32),
                per_px: (-1.0 / (half * slope)).as_vec2().to_array(),
                is_round,
                curved: curved.as_vec2().to_array(),
            }
        });
        let (x, y) = (by_u / slope.x, by_v / slope.y);
        Self {
            grows: growths.map(|growth| (picture / growth - 1.0) as f32),
            bend,
            linear: [[x.x - 1.0, y.x], [x.y, y.y - 1.0]].map(|row| row.map(|number| number as f32)),
            trace: (x.x + y.y - 2.0) as f32,
            per_area: (1.0 / x.perp_dot(y)) as f32,
            variance: variances[0] as f32,
            share: (variances[1] / (variances[0] + variances[1])) as f32,
        }
    }

    /// Its largest length on the edge of a rectangle about the picture's middle.
    #[inline(always)]
    pub(super) fn largest(&self, corner: [f32; 2]) -> f32 {
        const SIDES: Eight = [[-1.0, 0.0, 1.0, 1.0, 1.0, 0.0, -1.0, -1.0], [-1.0, -1.0, -1.0, 0.0, 1.0, 1.0, 1.0, 0.0]];
        let [x, y] = self.at(&[0, 1].map(|n| SIDES[n].map(|side| side * corner[n])));
        x.iter().zip(y).map(|(x, y)| x * x + y * y).fold(0.0, f32::max).sqrt()
    }

    /// The departure of eight pixels.
    #[inline(always)]
    fn at(&self, [x, y]: &Eight) -> Eight {
        let mut found = [[0f32; LANES]; 2];
        for k in 0..LANES {
            (found[0][k], found[1][k]) = (self.grows[0] * x[k], self.grows[1] * y[k]);
        }
        let Some(Bend { terms, stop, per_px, is_round, curved }) = &self.bend else { return found };
        for k in 0..LANES {
            let (u, v) = ((x[k] - stop[0]) * per_px[0], (y[k] - stop[1]) * per_px[1]);
            // Beside the stop rays bend as at its rim.
            let (u, v) = if *is_round {
                let inwards = 1.0 / (u * u + v * v).sqrt().max(1.0);
                (u * inwards, v * inwards)
            } else {
                (u.clamp(-1.0, 1.0), v.clamp(-1.0, 1.0))
            };
            found[0][k] += sum_of_terms(&terms[0], u, v) + curved[0];
            found[1][k] += sum_of_terms(&terms[1], u, v) + curved[1];
        }
        found
    }

    /// Moves the means of the first `count` pixels.
    #[inline(always)]
    pub(super) fn change(&self, PictureMeans { means, places, .. }: &mut PictureMeans, count: usize) {
        for first in (0..count).step_by(LANES) {
            let eight = |numbers: &Vec<f32>| -> [f32; LANES] {
                numbers[first..first + LANES].try_into().expect("eight pixels")
            };
            let moved = self.follow(&places.each_ref().map(eight), means.each_ref().map(eight));
            for (numbers, moved) in means.iter_mut().zip(&moved) {
                numbers[first..first + LANES].copy_from_slice(moved);
            }
        }
    }

    /// The numbers of the means of eight pixels at these places, from those of the picture.
    #[inline(always)]
    fn follow(&self, places: &Eight, means: [[f32; LANES]; NUMBERS]) -> [[f32; LANES]; NUMBERS] {
        let Self { linear: [[a, b], [c, d]], trace, per_area, variance: v, share, .. } = *self;
        let [across, down] = self.at(places);
        let (first, second) = (1.0 + trace, 0.5 * share * share);
        let mut moved = [[0f32; LANES]; NUMBERS];
        for k in 0..LANES {
            let [mean, x, y, xx, xy, yy] = means.map(|numbers| numbers[k]);
            let (at_x, at_y, dx, dy) = (places[0][k], places[1][k], across[k], down[k]);
            let (rest_x, rest_y) = (dx - a * at_x - b * at_y, dy - c * at_x - d * at_y);
            let square = |x: f32, y: f32| x * x * xx + 2.0 * x * y * xy + y * y * yy;
            let level = first * mean + dx * x + dy * y + v * (a * xx + (b + c) * xy + d * yy);
            moved[0][k] = per_area * (level + second * square(dx, dy) + (0.5 - second) * square(rest_x, rest_y));
            let (dx, dy) = (share * dx + (1.0 - share) * rest_x, share * dy + (1.0 - share) * rest_y);
            let (by_x, by_y) = ((a + trace) * x + c * y, b * x + (d + trace) * y);
            moved[1][k] = per_area * (x + dx * xx + dy * xy + share * by_x);
            moved[2][k] = per_area * (y + dx * xy + dy * yy + share * by_y);
            (moved[3][k], moved[4][k], moved[5][k]) = (per_area * xx, per_area * xy, per_area * yy);
        }
        moved
    }
}
