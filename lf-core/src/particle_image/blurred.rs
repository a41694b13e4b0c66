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

use super::axis::Axis;
use super::cell_surface::{Tables, nearest};
use super::lenslet_image::{LIGHT, LensletImage, Listed, PLACES, Patch, QUANTITIES, Scratch};
use super::lenslet_lines::LensletLine;
use super::normal::{density, distribution};
use super::place::Place;
use crate::{Camera, halo::Halo};
use glam::DVec2;

/// Blur of a camera, as the images of particles see it.
#[derive(Debug, Clone)]
pub(super) struct SensorBlur {
    /// Standard deviation of its Gaussian, px.
    pub(super) sigma_px: f64,
    /// Share of the light that the Gaussian stands for; the rest is in the camera's [`crate::halo::Halo`].
    share: f64,
    bell: Bell,
}

/// Mean of the cell's share over a pixel and the blur, with its derivatives by the place on the array and by the size
/// of the spot.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mean {
    pub(super) level: f64,
    pub(super) slope: [f64; 2],
    /// Second derivatives: xx, xy, yy.
    pub(super) curve: [f64; 3],
    pub(super) by_size: f64,
    /// Derivatives of slope and curvature by the size of the spot; 0 where they are not asked for.
    pub(super) slope_by_size: [f64; 2],
    pub(super) curve_by_size: [f64; 3],
}

/// How the blur widens a particle's spot on the array.
#[derive(Debug, Clone, Copy)]
pub(super) struct Widened {
    /// Standard deviation of spot and blur together, mm.
    pub(super) sigma_mm: f64,
    /// Its derivatives by the spot's own size, by alpha, mm, and by the blur, mm/px.
    by_spot: f64,
    by_alpha: f64,
    by_blur: f64,
    /// Whether the pixel is so small on the array that it counts as a part of the Gaussian.
    pub(super) has_pixel: bool,
}

/// Light farther from the sharp image than this many standard deviations of the blur is left out: 0.1 % on a side.
const REACH: f64 = 3.0;
/// Variance of a pixel, px^2.
const PIXEL_VARIANCE: f64 = 1.0 / 12.0;
/// A pixel below this width on the array, in standard deviations of the spot, counts as a part of the Gaussian.
const SMALL: f64 = 0.5;
/// A pixel with a smaller mean of the cell is dark.
const DARK: f64 = 1e-6;
/// The middle of the bump stays within this many standard deviations of the kernel.
const MOST_SHIFT: f64 = 3.0;
/// The variance of the bump is no less than this share of the kernel's.
const LEAST_VARIANCE: f64 = 0.05;

impl SensorBlur {
    /// None for a sharp camera.
    pub(super) fn new(camera: &Camera) -> Option<Self> {
        let sigma_px = camera.blur_core_px();
        let share = Halo::new(camera).map_or(1.0, |halo| halo.middle_share());
        (sigma_px > 0.0).then(|| Self { sigma_px, share, bell: Bell::new() })
    }

    /// Pixels beyond a sharp image that light reaches.
    pub(super) fn reach_px(&self) -> f64 {
        REACH * self.sigma_px
    }

    /// The spot of a particle on the array, widened by the blur. `px_by_stop` is how many pixels a millimetre of the
    /// stop covers.
    pub(super) fn widened(&self, spot_mm: f64, alpha: f64, px_by_stop: f64, is_bent: bool) -> Widened {
        let pixel_mm = 1.0 / px_by_stop.abs();
        let along = (alpha * pixel_mm).abs();
        let mut variance_px = self.sigma_px * self.sigma_px;
        // Bent rays are followed through the middle of each pixel.
        let has_pixel = is_bent || along < SMALL * spot_mm.hypot(along * self.sigma_px);
        if has_pixel {
            variance_px += PIXEL_VARIANCE;
        }
        let sigma_mm = (spot_mm * spot_mm + along * along * variance_px).sqrt();
        Widened {
            sigma_mm,
            by_spot: spot_mm / sigma_mm,
            by_alpha: alpha * pixel_mm * pixel_mm * variance_px / sigma_mm,
            by_blur: along * along * self.sigma_px / sigma_mm,
            has_pixel,
        }
    }
}

/// The share of a bump inside the stop, and its derivatives by the bump's middle and variances.
struct Inside {
    share: f64,
    by_middle: DVec2,
    by_variance: DVec2,
}

impl<T: Listed> LensletImage<'_, T> {
    /// Fills the scratch's pixels with light and derivatives by m, alpha, the spot's size, the lattice's shift and the
    /// blur.
    #[inline(always)]
    pub(super) fn blurred<const N: usize>(
        &self,
        (blur, surfaces): (&SensorBlur, &[Tables<T>]),
        line: &LensletLine,
        by_shift: f64,
        scratch: &mut Scratch,
    ) -> Option<Patch> {
        let half = self.view.optics.half_aperture_mm;
        let (axes, alpha) = self.axes(line);
        let (left, right) = lit(&axes[0], alpha.x, half, self.reach_mm.x, blur.sigma_px)?;
        let (top, bottom) = lit(&axes[1], alpha.y, half, self.reach_mm.y, blur.sigma_px)?;

        // Widen the spot by the blur under this lenslet.
        let px_by_stop = (axes[0].slope.abs() + axes[1].slope.abs()) / 2.0;
        let alpha_mean = 0.5 * (alpha.x + alpha.y);
        let widened = blur.widened(self.spot_mm, alpha_mean, px_by_stop, self.beam.is_bent());
        let tables = nearest(surfaces, widened.sigma_mm);
        let more_mm = widened.sigma_mm - tables.sigma_mm;

        // Place the edges and the middles of the pixels on the stop and on the array.
        for (axis, (first, end)) in [(left, right), (top, bottom)].into_iter().enumerate() {
            let place = |at: f64| axes[axis].place(at, alpha[axis], by_shift, f64::INFINITY);
            let (edges, points) = (&mut scratch.edges[axis], &mut scratch.points[axis]);
            edges.clear();
            edges.extend((first..=end).map(|n| place(n as f64)));
            points.clear();
            points.extend((first..end).map(|n| place(n as f64 + 0.5)));
        }

        // Take the mean of the cell over each pixel.
        if self.beam.is_bent() {
            scratch.hits.clear();
            for y in &scratch.points[1] {
                let hit = |x: &Place| self.beam.hit(DVec2::new(x.u, y.u), half) - line.centre;
                scratch.hits.extend(scratch.points[0].iter().map(hit));
            }
            T::means_at::<N>(&tables.share, more_mm, scratch);
        } else {
            T::means::<N>(tables, more_mm, widened.has_pixel, scratch);
        }

        // Multiply it by the share that the stop lets through.
        let Scratch { points, means, pixels, .. } = scratch;
        pixels.clear();
        pixels.resize(means.len(), [0.0; QUANTITIES]);
        let per_slope = DVec2::new(axes[0].per_slope, axes[1].per_slope);
        let kernel = (PIXEL_VARIANCE + blur.sigma_px * blur.sigma_px) * per_slope * per_slope;
        let scale = blur.share * (per_slope.x * per_slope.y).abs() / self.view.stop_mm2;
        let growth = axes[0].gamma * per_slope.x + axes[1].gamma * per_slope.y;
        let pixel = Pixel { half, alpha, kernel, scale, growth, is_round: self.view.has_round_stop };
        let columns = points[0].len();
        for (n, mean) in means.iter().enumerate() {
            if mean.level > DARK {
                let (x, y) = (&points[0][n % columns], &points[1][n / columns]);
                pixel.light::<N>(blur, &widened, mean, [x, y], per_slope, &mut pixels[n]);
            }
        }
        let [column, row] = [left, top].map(|first| first as u32);
        Some(Patch { column, row, columns: (right - left) as u32, rows: (bottom - top) as u32 })
    }
}

/// First and end pixel that are lit along an axis, for a cell that reaches `reach` from the lenslet's centre.
#[inline(always)]
fn lit(axis: &Axis, alpha: f64, half: f64, reach: f64, sigma_px: f64) -> Option<(i64, i64)> {
    let [low, high] = axis.lit_px(alpha, half, reach)?;
    let first = (low - REACH * sigma_px).floor().max(0.0) as i64;
    let end = (high + REACH * sigma_px).ceil().clamp(0.0, axis.pixels as f64) as i64;
    (first < end).then_some((first, end))
}

/// Numbers that all pixels of a lenslet share.
struct Pixel {
    half: f64,
    alpha: DVec2,
    /// Variance of the pixel's kernel in the stop, mm^2.
    kernel: DVec2,
    /// Area of a pixel in the stop over the stop's.
    scale: f64,
    /// Relative growth of that area with alpha.
    growth: f64,
    is_round: bool,
}

impl Pixel {
    /// The light of a pixel and its derivatives.
    #[inline(always)]
    fn light<const N: usize>(
        &self,
        blur: &SensorBlur,
        widened: &Widened,
        mean: &Mean,
        [x, y]: [&Place; 2],
        per_slope: DVec2,
        out: &mut [f64; QUANTITIES],
    ) {
        let Self { alpha, kernel, scale, .. } = *self;
        // Find the middle and the variance of the bump from the logarithm of the mean.
        let level = mean.level;
        let slope = DVec2::from(mean.slope) / level;
        let [xx, xy, yy] = mean.curve.map(|curve| curve / level);
        let (xx, xy, yy) = (xx - slope.x * slope.x, xy - slope.x * slope.y, yy - slope.y * slope.y);
        let most = MOST_SHIFT * DVec2::new(kernel.x.sqrt(), kernel.y.sqrt());
        let middle = DVec2::new(x.u, y.u) + (kernel * alpha * slope).clamp(-most, most);
        let curve = DVec2::new(alpha.x * alpha.x * xx, alpha.y * alpha.y * yy);
        let variance = (kernel + kernel * kernel * curve).max(LEAST_VARIANCE * kernel);
        let mixed = kernel.x * kernel.y * alpha.x * alpha.y * xy;
        let Some(inside) = self.inside(&blur.bell, middle, variance, mixed) else { return };
        let share = scale * inside.share;
        out[0] = share * level;
        if N <= LIGHT {
            return;
        }
        // Follow both factors: the mean by its slopes, the share by the middle of the bump.
        let level = scale * level;
        let by = |x_by: f64, y_by: f64, u_by: DVec2| {
            let moved = u_by + kernel * alpha * DVec2::new(xx * x_by + xy * y_by, xy * x_by + yy * y_by);
            share * (mean.slope[0] * x_by + mean.slope[1] * y_by) + level * inside.by_middle.dot(moved)
        };
        out[1] = by(x.x_by[0], 0.0, DVec2::new(x.u_by[0], 0.0));
        out[2] = by(0.0, y.x_by[0], DVec2::new(0.0, y.u_by[0]));
        let turned = DVec2::new(x.u_by[1], y.u_by[1]) + kernel * slope;
        out[3] = by(x.x_by[1], y.x_by[1], turned) + share * mean.by_size * widened.by_alpha + out[0] * self.growth;
        if N <= PLACES {
            return;
        }
        // The bump moves and narrows with the size of the spot, through both derivatives of the logarithm.
        let per_level = 1.0 / mean.level;
        let slope_by = (DVec2::from(mean.slope_by_size) - mean.by_size * slope) * per_level;
        let [xx_by, _, yy_by] = mean.curve_by_size.map(|curve| curve * per_level);
        let [raw_xx, _, raw_yy] = mean.curve.map(|curve| curve * per_level);
        let curve_by = DVec2::new(
            alpha.x * alpha.x * (xx_by - raw_xx * mean.by_size * per_level - 2.0 * slope.x * slope_by.x),
            alpha.y * alpha.y * (yy_by - raw_yy * mean.by_size * per_level - 2.0 * slope.y * slope_by.y),
        );
        let by_bump =
            inside.by_middle.dot(kernel * alpha * slope_by) + inside.by_variance.dot(kernel * kernel * curve_by);
        let by_size = share * mean.by_size + level * by_bump;
        out[4] = by_size * widened.by_spot;
        out[3] += (by_size - share * mean.by_size) * widened.by_alpha;
        out[5] = by(x.x_by[2], 0.0, DVec2::new(x.u_by[2], 0.0));
        out[6] = by(0.0, y.x_by[2], DVec2::new(0.0, y.u_by[2]));
        let kernel_by = 2.0 * blur.sigma_px * per_slope * per_slope;
        let variance_by = kernel_by * (1.0 + 2.0 * kernel * curve);
        let by_inside = inside.by_middle.dot(kernel_by * alpha * slope) + inside.by_variance.dot(variance_by);
        out[7] = by_size * widened.by_blur + level * by_inside;
    }

    /// The share of a normal bump that lies inside the stop; None if that is nothing.
    #[inline(always)]
    fn inside(&self, bell: &Bell, middle: DVec2, variance: DVec2, mixed: f64) -> Option<Inside> {
        if self.is_round {
            // The rim is a parabola near the bump: it leaves out what the bump's width along the rim bends away.
            let radius = middle.length().max(f64::MIN_POSITIVE);
            let out = middle / radius;
            let (square, cross) = (out * out, 2.0 * out.x * out.y * mixed);
            let across = (square.dot(variance) + cross).max(LEAST_VARIANCE * self.kernel.min_element());
            let along = (square.y * variance.x + square.x * variance.y - cross).max(0.0);
            let sigma = across.sqrt();
            let z = (self.half - radius - 0.5 * along / self.half) / sigma;
            let (share, density) = bell.at(z)?;
            let by_variance = (-0.5 * density * z / across) * square;
            return Some(Inside { share, by_middle: (-density / sigma) * out, by_variance });
        }
        let side = |u: f64, variance: f64| {
            let sigma = variance.sqrt();
            let z = (self.half - u.abs()) / sigma;
            let (share, density) = bell.at(z)?;
            Some((share, -density / sigma.copysign(u), -0.5 * density * z / variance))
        };
        let (x, y) = (side(middle.x, variance.x)?, side(middle.y, variance.y)?);
        Some(Inside {
            share: x.0 * y.0,
            by_middle: DVec2::new(x.1 * y.0, x.0 * y.1),
            by_variance: DVec2::new(x.2 * y.0, x.0 * y.2),
        })
    }
}

/// The normal distribution as a table.
#[derive(Debug, Clone)]
struct Bell(Vec<[f64; 2]>);

/// Range and nodes of the table.
const BELL_REACH: f64 = 5.0;
const BELL_STEPS: f64 = 32.0;

impl Bell {
    fn new() -> Self {
        let count = (2.0 * BELL_REACH * BELL_STEPS) as usize;
        let at = |n: usize| n as f64 / BELL_STEPS - BELL_REACH;
        Self((0..=count + 1).map(|n| [distribution(at(n)), density(at(n)) / BELL_STEPS]).collect())
    }

    /// Distribution and density; None far below 0. By cubics, to 1e-8.
    #[inline(always)]
    fn at(&self, z: f64) -> Option<(f64, f64)> {
        if z >= BELL_REACH {
            return Some((1.0, 0.0));
        }
        let place = (z + BELL_REACH) * BELL_STEPS;
        if place <= 0.0 {
            return None;
        }
        let n = place as usize;
        let t = place - n as f64;
        let ([a, da], [b, db]) = (self.0[n], self.0[n + 1]);
        let (c, d) = (3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db);
        Some((a + t * (da + t * (c + t * d)), BELL_STEPS * (da + t * (2.0 * c + 3.0 * t * d))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_normal_distribution() {
        let bell = Bell::new();
        for n in 0..998 {
            let z = -4.99 + 0.01 * f64::from(n);
            let (share, slope) = bell.at(z).unwrap_or_default();
            assert!((share - distribution(z)).abs() < 1e-7 && (slope - density(z)).abs() < 3e-5, "{z}");
        }
        assert!(bell.at(-5.1).is_none());
        assert_eq!(bell.at(7.0), Some((1.0, 0.0)));
    }
}
