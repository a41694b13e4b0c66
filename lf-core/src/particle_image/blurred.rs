//! A lenslet's image of a particle on a blurred sensor.
//!
//! A pixel counts the light around it with a kernel K, the pixel convolved with the blur's Gaussian. Seen through the
//! lenslet, K lies in the stop, beside the stop S itself and the lenslet's cell H:
//!
//! ```text
//! light = 1/A int S(U) H(m + alpha U - c) K(U) dU
//! ```
//!
//! The mean M of H over K is exact: it is the sharp cell's mean over the pixel, from tables for a spot of variance
//! `spot^2 + (alpha b)^2`, where b is the blur in the stop. The product H K is a small bump. Its middle and variance
//! follow from M (`v` is the variance of K):
//!
//! ```text
//! middle = U + v grad ln M,   variance = v + v^2 grad grad ln M
//! light  = M area(pixel) / A * (share of a normal bump of this middle and variance that lies inside the stop)
//! ```
//!
//! So all stops and all cells are one case. Against rays the light errs by 0.1 to 1.1 % of the particle's.
//! Where the stop cuts nothing of what the cell takes of the spot, it drops out: the light is `M area(pixel) / A`.

use super::axis::Axis;
use super::cell_surface::{Ladder, REACH_SIGMA};
use super::lenslet_image::{Cut, Hit, LensletImage, Listed, PLACES, Patch, QUANTITIES, Scratch};
use super::lenslet_lines::LensletLine;
use super::mean::{FourPlaces, LANES, Mean};
use super::place::Place;
use super::sensor_blur::{Bell, PIXEL_VARIANCE, SensorBlur, Widened};
use super::view::View;
use glam::{DVec2, DVec4};

/// A pixel with a smaller mean of the cell is dark.
const DARK: f64 = 1e-6;
/// The middle of the bump stays within this many standard deviations of the kernel.
pub(super) const MOST_SHIFT: f64 = 3.0;
/// A pixel on the array is no narrower than this share of the spot, so that differences keep their digits.
const LEAST_WIDTH: f64 = 0.05;
/// Largest correction of a blur's variance, over the variance.
const MOST_STRETCH: f64 = 0.6;
/// The variance of the bump is no less than this share of the kernel's.
pub(super) const LEAST_VARIANCE: f64 = 0.05;

/// The shares of four bumps inside the stop, and their derivatives by the bumps' middles and variances.
struct Inside {
    share: DVec4,
    by_middle: [DVec4; 2],
    by_variance: [DVec4; 2],
}

impl<T: Listed> LensletImage<'_, T> {
    /// Fills the scratch's pixels with light and derivatives by m, alpha, the spot's size, the lattice's shift and the
    /// blur.
    #[inline(always)]
    pub(super) fn blurred<const N: usize>(
        &self,
        (blur, ladder): (&SensorBlur, &Ladder<T>),
        line: &LensletLine,
        by_shift: f64,
        scratch: &mut Scratch,
    ) -> Option<Patch> {
        let half = self.view.optics.half_aperture_mm;
        let (axes, alpha) = self.axes(line);
        let (left, right) = self.lit(0, &axes[0], alpha.x)?;
        let (top, bottom) = self.lit(1, &axes[1], alpha.y)?;

        // Widen the spot by the blur under this lenslet.
        let px_by_stop = (axes[0].slope.abs() + axes[1].slope.abs()) / 2.0;
        let alpha_mean = 0.5 * (alpha.x + alpha.y);
        let widened = blur.widened(self.spot_mm, alpha_mean, px_by_stop);

        // Place the edges of the pixels on the stop and on the array, and their middles where the stop cuts.
        let place = |axis: usize, at: f64| axes[axis].place(at, alpha[axis], by_shift, f64::INFINITY);
        for (axis, (first, end)) in [(left, right), (top, bottom)].into_iter().enumerate() {
            scratch.edges[axis].clear();
            scratch.edges[axis].extend((first..=end).map(|n| place(axis, n as f64)));
        }
        let [column, row] = [left, top].map(|first| first as u32);
        let patch = Patch { column, row, columns: (right - left) as u32, rows: (bottom - top) as u32 };
        if !self.beam.is_bent() && !widened.has_pixel && self.is_inside_stop(&axes, alpha) {
            self.unshaded((blur, ladder), &widened, Cut::none(patch.columns, alpha, line.centre), scratch);
            return Some(patch);
        }
        for (axis, (first, end)) in [(left, right), (top, bottom)].into_iter().enumerate() {
            scratch.points[axis].clear();
            scratch.points[axis].extend((first..end).map(|n| place(axis, n as f64 + 0.5)));
        }

        // Take the mean of the cell over each pixel.
        let per_slope = DVec2::new(axes[0].per_slope, axes[1].per_slope);
        let kernel = blur.kernel_px2() * per_slope * per_slope;
        if self.beam.is_bent() {
            self.follow_bent_rays(blur, line, (kernel, per_slope), scratch);
            T::means_at::<N>(ladder, scratch);
            self.stretch(blur, scratch);
        } else {
            let tables = ladder.nearest(widened.sigma_mm);
            T::means::<N>(tables, widened.sigma_mm - tables.sigma_mm, widened.has_pixel, scratch);
        }

        // Multiply it by the share that the stop lets through.
        let Scratch { points, means, fours, pixels, hits, .. } = scratch;
        pixels.clear();
        pixels.resize(points[0].len() * points[1].len(), [0.0; QUANTITIES]);
        let scale = blur.share * (per_slope.x * per_slope.y).abs() / self.view.stop_mm2;
        let growth = axes[0].gamma * per_slope.x + axes[1].gamma * per_slope.y;
        let pixel = Pixel {
            half,
            per_half: 1.0 / half,
            kernel,
            most_shift: MOST_SHIFT * DVec2::new(kernel.x.sqrt(), kernel.y.sqrt()),
            scale,
            growth,
            is_round: self.view.has_round_stop,
        };
        let columns = points[0].len();
        fours.clear();
        for first in (0..columns).step_by(LANES) {
            fours.push(FourPlaces::new(&points[0], first));
        }
        let mut means = means.iter();
        let straight = Spread::straight(alpha);
        for (n, (y, row)) in points[1].iter().zip(pixels.chunks_mut(columns)).enumerate() {
            for (first, ((x, mean), out)) in fours.iter().zip(&mut means).zip(row.chunks_mut(LANES)).enumerate() {
                let spread = match self.beam.is_bent() {
                    true => Spread::of(&hits[n * columns + LANES * first..][..out.len()], per_slope),
                    false => straight,
                };
                pixel.light::<N>(blur, &widened, (mean, &spread), (x, y), per_slope, out);
            }
        }
        Some(patch)
    }

    /// Whether the stop cuts nothing of what the cell takes of the spot: then a pixel's light is the cell's mean.
    #[inline(always)]
    pub(super) fn is_inside_stop(&self, axes: &[Axis; 2], alpha: DVec2) -> bool {
        let View { corner, cell_radius, has_round_stop, ref optics, .. } = *self.view;
        let (chief, reach) = (DVec2::new(axes[0].chief, axes[1].chief), REACH_SIGMA * self.spot_mm);
        let far = match has_round_stop {
            true => (chief.length() + cell_radius + reach) / alpha.abs().min_element(),
            false => ((chief.abs() + corner + reach) / alpha.abs()).max_element(),
        };
        far < optics.half_aperture_mm
    }

    /// Fills the scratch's pixels where the stop cuts nothing: as on a sharp sensor, with a wider spot.
    #[inline(always)]
    fn unshaded(&self, (blur, ladder): (&SensorBlur, &Ladder<T>), widened: &Widened, cut: Cut, scratch: &mut Scratch) {
        let tables = ladder.nearest(widened.sigma_mm);
        let more_mm = widened.sigma_mm - tables.sigma_mm;
        let image = LensletImage { tables, spot_mm: widened.sigma_mm, more_mm, ..*self };
        scratch.pixels.clear();
        scratch.pixels.resize((scratch.edges[0].len() - 1) * (scratch.edges[1].len() - 1), [0.0; QUANTITIES]);
        T::integrate::<QUANTITIES>(&image, scratch, cut);
        for pixel in &mut scratch.pixels {
            pixel.iter_mut().for_each(|number| *number *= blur.share);
            let by_size = pixel[4];
            pixel[3] += by_size * widened.by_alpha;
            (pixel[4], pixel[7]) = (by_size * widened.by_spot, by_size * widened.by_blur);
        }
    }

    /// Mean place and variance of the part of a normal bump that passes the stop, from those of the bump.
    #[inline(always)]
    fn part_inside(&self, bell: &Bell, middle: DVec2, variance: DVec2) -> [DVec2; 2] {
        let half = self.view.optics.half_aperture_mm;
        // A bump that is cut at one side: the shift of its mean, and the share of its variance that is left.
        let cut = |at: f64, sigma: f64| {
            let z = (half - at) / sigma;
            bell.at(z).map_or((half - at, 0.0), |(share, density)| {
                let hazard = density / share;
                (-sigma * hazard, 1.0 - hazard * (z + hazard))
            })
        };
        if self.view.has_round_stop {
            let radius = middle.length().max(f64::MIN_POSITIVE);
            let (shift, share) = cut(radius, (0.5 * (variance.x + variance.y)).sqrt());
            return [middle * (1.0 + shift / radius), share * variance];
        }
        let (x, y) = (cut(middle.x.abs(), variance.x.sqrt()), cut(middle.y.abs(), variance.y.sqrt()));
        [middle + middle.signum() * DVec2::new(x.0, y.0), variance * DVec2::new(x.1, y.1)]
    }

    /// Finds where the rays through the middles of the pixels meet the array, and how wide pixels are there. Rays bend
    /// as they do where the light of the pixel's `kernel` (its variance) passes the stop; beside the stop they have no
    /// meaning.
    #[inline(always)]
    fn follow_bent_rays(
        &self,
        blur: &SensorBlur,
        line: &LensletLine,
        (kernel, per_slope): (DVec2, DVec2),
        scratch: &mut Scratch,
    ) {
        let half = self.view.optics.half_aperture_mm;
        let Scratch { hits, points, .. } = scratch;
        hits.clear();
        for at in points[1].iter().flat_map(|y| points[0].iter().map(|x| DVec2::new(x.u, y.u))) {
            let [middle, variance] = self.part_inside(&blur.bell, at, kernel);
            let [by_u, by_v] = self.beam.slopes(middle, half);
            let [across, down] = self.beam.curvature(middle, half);
            let step = at - middle;
            // The pixel takes the mean of hits, which their curvature moves.
            let bent = 0.5 * (variance.x * across + variance.y * down);
            let place = self.beam.hit(middle, half) + step.x * by_u + step.y * by_v + bent - line.centre;
            let [a, b] = [per_slope.x * by_u, per_slope.y * by_v];
            let along = (0.5 * (a.length_squared() + b.length_squared())).sqrt();
            let Widened { sigma_mm, has_pixel, .. } = blur.widened(self.spot_mm, along, 1.0);
            let width = DVec2::new(a.x, b.y).abs().max(DVec2::splat(LEAST_WIDTH * sigma_mm));
            hits.push(Hit { place, width, by_px: [a, b], sigma_mm, has_pixel });
        }
    }
}

impl<T: Listed> LensletImage<'_, T> {
    /// Corrects the means of bent rays. The tables have a round blur and upright pixels; on the array bent rays make
    /// the sensor's round blur an ellipse, and its pixels rhombs. What they are wider spreads the means like heat.
    #[inline(always)]
    fn stretch(&self, blur: &SensorBlur, scratch: &mut Scratch) {
        let Scratch { hits, points, means, .. } = scratch;
        let columns = points[0].len();
        let variance = blur.kernel_px2();
        for (n, hit) in hits.iter().enumerate() {
            let [a, b] = hit.by_px;
            let most = MOST_STRETCH * hit.sigma_mm * hit.sigma_mm;
            let round = hit.sigma_mm * hit.sigma_mm - self.spot_mm * self.spot_mm;
            // Upright pixels are in the mean, unless they are in the round blur.
            let pixel = if hit.has_pixel { DVec2::ZERO } else { PIXEL_VARIANCE * DVec2::new(a.x * a.x, b.y * b.y) };
            let square = variance * (a * a + b * b) - pixel - round;
            let mixed = variance * (a.x * a.y + b.x * b.y);
            let (row, column) = (n / columns, n % columns);
            let mean = &mut means[row * columns.div_ceil(LANES) + column / LANES];
            let [level, _, _, xx, xy, yy] = [0, 1, 2, 3, 4, 5].map(|k| mean[k][column % LANES]);
            let more = square.clamp(DVec2::splat(-most), DVec2::splat(most));
            let added = 0.5 * (more.x * xx + more.y * yy) + mixed.clamp(-most, most) * xy;
            mean[0][column % LANES] = (level + added).max(0.0);
        }
    }
}

/// Numbers that all pixels of a lenslet share.
struct Pixel {
    half: f64,
    per_half: f64,
    /// Variance of the pixel's kernel in the stop, mm^2.
    kernel: DVec2,
    /// Largest shift of the bump's middle, mm.
    most_shift: DVec2,
    /// Area of a pixel in the stop over the stop's.
    scale: f64,
    /// Relative growth of that area with alpha.
    growth: f64,
    is_round: bool,
}

/// How far four rays move on the array with their places in the stop, along x and along y.
#[derive(Clone, Copy)]
struct Spread {
    by_u: [DVec4; 2],
    by_v: [DVec4; 2],
}

impl Spread {
    #[inline(always)]
    fn straight(alpha: DVec2) -> Self {
        Self { by_u: [DVec4::splat(alpha.x), DVec4::ZERO], by_v: [DVec4::ZERO, DVec4::splat(alpha.y)] }
    }

    /// For up to four bent rays.
    #[inline(always)]
    fn of(hits: &[Hit], per_slope: DVec2) -> Self {
        let number = |axis: usize, along: usize| {
            let one = |hit: &Hit| hit.by_px[axis][along] / per_slope[axis];
            DVec4::from_array(std::array::from_fn(|n| hits.get(n).map_or(0.0, one)))
        };
        Self { by_u: [number(0, 0), number(0, 1)], by_v: [number(1, 0), number(1, 1)] }
    }
}

/// The slope and the curvature of the logarithm of a mean.
struct Logarithm {
    per_level: DVec4,
    slope: [DVec4; 2],
    xx: DVec4,
    xy: DVec4,
    yy: DVec4,
}

impl Logarithm {
    #[inline(always)]
    fn of(mean: &Mean) -> Self {
        let number = |n: usize| DVec4::from_array(mean[n]);
        let per_level = 1.0 / number(0).max(DVec4::splat(DARK));
        let slope = [number(1) * per_level, number(2) * per_level];
        Self {
            per_level,
            slope,
            xx: number(3) * per_level - slope[0] * slope[0],
            xy: number(4) * per_level - slope[0] * slope[1],
            yy: number(5) * per_level - slope[1] * slope[1],
        }
    }

    /// The derivatives by the size of the slope, and of the curvature along x and y.
    #[inline(always)]
    fn by_size(&self, mean: &Mean) -> ([DVec4; 2], [DVec4; 2]) {
        let by = |n: usize| DVec4::from_array(mean[n]) * self.per_level;
        let level = by(6);
        let slope = [by(7) - level * self.slope[0], by(8) - level * self.slope[1]];
        let along = by(9) - by(3) * level - 2.0 * self.slope[0] * slope[0];
        let across = by(11) - by(5) * level - 2.0 * self.slope[1] * slope[1];
        (slope, [along, across])
    }
}

/// Hands the numbers of four pixels out, except to dark ones.
#[inline(always)]
fn scatter<const N: usize>(mean: &Mean, numbers: &[DVec4; QUANTITIES], out: &mut [[f64; QUANTITIES]]) {
    let numbers = numbers.map(|numbers| numbers.to_array());
    for (k, pixel) in out.iter_mut().enumerate() {
        if mean[0][k] > DARK {
            for n in 0..N {
                pixel[n] = numbers[n][k];
            }
        }
    }
}

impl Pixel {
    /// The light of up to four pixels and its derivatives.
    #[inline(always)]
    fn light<const N: usize>(
        &self,
        blur: &SensorBlur,
        widened: &Widened,
        (mean, spread): (&Mean, &Spread),
        (x, y): (&FourPlaces, &Place),
        per_slope: DVec2,
        out: &mut [[f64; QUANTITIES]],
    ) {
        let Self { kernel, scale, .. } = *self;
        let number = |n: usize| DVec4::from_array(mean[n]);
        let (mean_level, mean_slope, by_size) = (number(0), [number(1), number(2)], number(6));
        let log = Logarithm::of(mean);
        let Logarithm { slope, xx, xy, yy, .. } = log;
        // Find the middle and the variance of the bump from the logarithm of the mean, followed along the stop.
        let along_stop = |by: [DVec4; 2]| [by[0] * xx + by[1] * xy, by[0] * xy + by[1] * yy];
        let Spread { by_u, by_v } = *spread;
        let curves = [along_stop(by_u), along_stop(by_v)];
        let shifts = [by_u[0] * slope[0] + by_u[1] * slope[1], by_v[0] * slope[0] + by_v[1] * slope[1]];
        let most = [DVec4::splat(self.most_shift.x), DVec4::splat(self.most_shift.y)];
        let middle = [
            x.u + (kernel.x * shifts[0]).max(-most[0]).min(most[0]),
            y.u + (kernel.y * shifts[1]).max(-most[1]).min(most[1]),
        ];
        let curve = [by_u[0] * curves[0][0] + by_u[1] * curves[0][1], by_v[0] * curves[1][0] + by_v[1] * curves[1][1]];
        let variance = [
            (kernel.x + kernel.x * kernel.x * curve[0]).max(DVec4::splat(LEAST_VARIANCE * kernel.x)),
            (kernel.y + kernel.y * kernel.y * curve[1]).max(DVec4::splat(LEAST_VARIANCE * kernel.y)),
        ];
        let mixed = kernel.x * kernel.y * (by_v[0] * curves[0][0] + by_v[1] * curves[0][1]);
        let inside = self.inside(&blur.bell, middle, variance, mixed);
        let share = scale * inside.share;
        let mut numbers = [DVec4::ZERO; QUANTITIES];
        numbers[0] = share * mean_level;
        // Follow both factors: the mean by its slopes, the share by the middle of the bump.
        let level = scale * mean_level;
        let by_middle = [level * inside.by_middle[0], level * inside.by_middle[1]];
        let by_hit = [0, 1].map(|n| {
            share * mean_slope[n] + by_middle[0] * (kernel.x * curves[0][n]) + by_middle[1] * (kernel.y * curves[1][n])
        });
        let along = |x_by: DVec4, u_by: DVec4| by_hit[0] * x_by + by_middle[0] * u_by;
        let across = |y_by: f64, u_by: f64| by_hit[1] * y_by + by_middle[1] * u_by;
        let turned = kernel.x * by_middle[0] * slope[0] + kernel.y * by_middle[1] * slope[1];
        numbers[1] = along(x.x_by[0], x.u_by[0]);
        numbers[2] = across(y.x_by[0], y.u_by[0]);
        numbers[3] = along(x.x_by[1], x.u_by[1])
            + across(y.x_by[1], y.u_by[1])
            + turned
            + share * by_size * widened.by_alpha
            + numbers[0] * self.growth;
        if N > PLACES {
            // The bump moves and narrows with the size of the spot, through both derivatives of the logarithm.
            let (slope_by, curve_by) = log.by_size(mean);
            let by_variance = [level * inside.by_variance[0], level * inside.by_variance[1]];
            let by_bump = |n: usize| {
                let spread = kernel[n] * [by_u[0], by_v[1]][n];
                by_middle[n] * spread * slope_by[n] + by_variance[n] * (spread * spread) * curve_by[n]
            };
            let by_bump = by_bump(0) + by_bump(1);
            let by_size = share * by_size + by_bump;
            numbers[3] += by_bump * widened.by_alpha;
            numbers[4] = by_size * widened.by_spot;
            numbers[5] = along(x.x_by[2], x.u_by[2]);
            numbers[6] = across(y.x_by[2], y.u_by[2]);
            let kernel_by = 2.0 * blur.sigma_px * per_slope * per_slope;
            let by_inside = |n: usize| {
                let variance_by = kernel_by[n] * (1.0 + 2.0 * kernel[n] * curve[n]);
                by_middle[n] * kernel_by[n] * shifts[n] + by_variance[n] * variance_by
            };
            numbers[7] = by_size * widened.by_blur + by_inside(0) + by_inside(1);
        }
        scatter::<N>(mean, &numbers, out);
    }

    /// The shares of normal bumps that lie inside the stop.
    #[inline(always)]
    fn inside(&self, bell: &Bell, middle: [DVec4; 2], variance: [DVec4; 2], mixed: DVec4) -> Inside {
        if self.is_round {
            // The rim is a parabola near the bump: it leaves out what the bump's width along the rim bends away.
            let square = middle[0] * middle[0] + middle[1] * middle[1];
            let radius = root(square).max(DVec4::splat(f64::MIN_POSITIVE));
            let per_radius = 1.0 / radius;
            let out = [middle[0] * per_radius, middle[1] * per_radius];
            let square = [out[0] * out[0], out[1] * out[1]];
            let cross = 2.0 * out[0] * out[1] * mixed;
            let across = square[0] * variance[0] + square[1] * variance[1] + cross;
            let across = across.max(DVec4::splat(LEAST_VARIANCE * self.kernel.min_element()));
            let along = (square[1] * variance[0] + square[0] * variance[1] - cross).max(DVec4::ZERO);
            let per_sigma = 1.0 / root(across);
            let z = (self.half - radius - (0.5 * self.per_half) * along) * per_sigma;
            let (share, density) = bell.four(z);
            let by_middle = -density * per_sigma;
            let by_variance = 0.5 * by_middle * z * per_sigma;
            return Inside {
                share,
                by_middle: [by_middle * out[0], by_middle * out[1]],
                by_variance: [by_variance * square[0], by_variance * square[1]],
            };
        }
        let (x, y) = (self.side(bell, middle[0], variance[0]), self.side(bell, middle[1], variance[1]));
        Inside { share: x.0 * y.0, by_middle: [x.1 * y.0, x.0 * y.1], by_variance: [x.2 * y.0, x.0 * y.2] }
    }

    /// The shares of normal bumps between two sides of a square stop, and their derivatives by middle and variance.
    #[inline(always)]
    fn side(&self, bell: &Bell, u: DVec4, variance: DVec4) -> (DVec4, DVec4, DVec4) {
        let per_sigma = 1.0 / root(variance);
        let z = (self.half - u.abs()) * per_sigma;
        let (share, density) = bell.four(z);
        (share, -density * per_sigma.copysign(u), -0.5 * density * z * per_sigma * per_sigma)
    }
}

#[inline(always)]
fn root(square: DVec4) -> DVec4 {
    DVec4::new(square.x.sqrt(), square.y.sqrt(), square.z.sqrt(), square.w.sqrt())
}
