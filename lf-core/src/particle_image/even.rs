//! A lenslet's image of a particle on a blurred sensor: light and derivatives by place, from a picture of the cell
//! (`pictures.rs`).
//!
//! It is the light of `fine.rs`, all blur at once, in pixels of the sensor: the mean M of the cell over a pixel, times
//! the share of a bump that the stop lets through. Along an axis the picture's middle is at `zero + g chief` and its
//! scale is |g|, with `g = slope / alpha`. Lenslets depart a little from a picture that they share (`departure.rs`).

use super::axis::Axis;
use super::cell_surface::{Ladder, REACH_SIGMA};
use super::departure::{Bumps, Departure, Stop};
use super::fine::{DARK, MOST_SHIFT};
use super::inside::{LEAST_VARIANCE, StopRim};
use super::lenslet_image::{Cut, LensletImage, Listed, Patch, Scratch};
use super::lenslet_lines::LensletLine;
use super::picture_means::{NUMBERS, PictureMeans};
use super::pictures::LANES;
use super::quantities::{LIGHT, PLACES, QUANTITIES};
use super::sensor_blur::SensorBlur;
use super::view::View;
use crate::simd::fastest;
use glam::DVec2;

/// Largest departure of a lenslet from a picture, px at the edge of its cell.
const FARTHEST_PX: f32 = 0.12;
/// Largest growth from one lenslet's picture to another's, px at its edge, and as a share. Lenslets before a tilted
/// sensor differ in scale.
const GROWTH_PX: f64 = 0.05;
const GROWTH: f64 = 0.05;
/// Lenslets whose pictures grow by less share one.
const NO_GROWTH: f64 = 1e-6;

/// Numbers that all pixels of a lenslet share: derivatives are by m along x, m along y and alpha.
struct Factors {
    /// From the mean to light.
    scale: f32,
    /// Growth of the light with alpha by that of a pixel in the stop.
    growth: f32,
    /// Motion of the picture's middle along both axes, px.
    moves: [[f32; 2]; 3],
    /// Relative growth of the picture with alpha.
    grows: f32,
    /// Motion of the stop's middle by m, px, along both axes; growth of its half side with alpha.
    stop_moves: [f32; 2],
    stop_grows: f32,
    stop: Stop,
    /// The variance of the kernel, px^2.
    variance: f32,
    /// From derivatives by m and alpha to those by x, y and z.
    to_place: [[f32; 3]; 3],
}

impl<T: Listed> LensletImage<'_, T> {
    /// Whether the stop cuts nothing of what the cell takes of the spot.
    #[inline(always)]
    pub(super) fn is_inside_stop(&self, axes: &[Axis; 2], alpha: DVec2) -> bool {
        let View { corner, cell_radius, has_round_stop, ref optics, .. } = *self.view;
        let growth = Self::growths(axes, alpha).1.abs();
        let fringes_mm = self.view.rim_px(growth) / growth;
        let (chief, reach) = (DVec2::new(axes[0].chief, axes[1].chief), REACH_SIGMA * self.spot_mm + fringes_mm);
        let far = match has_round_stop {
            true => (chief.length() + cell_radius + reach) / alpha.abs().min_element(),
            false => ((chief.abs() + corner + reach) / alpha.abs()).max_element(),
        };
        far < optics.half_aperture_mm
    }

    /// Fills the scratch's pixels with all quantities where rays are straight and the stop cuts nothing: as on a sharp
    /// sensor, with a wider spot. The outer option is None if rays bend or the stop cuts something.
    #[inline(always)]
    pub(super) fn unshaded(
        &self,
        (blur, ladder): (&SensorBlur, &Ladder<T>),
        by_shift: f64,
        line: &LensletLine,
        scratch: &mut Scratch,
    ) -> Option<Option<Patch>> {
        let (axes, alpha) = self.axes(line);
        if self.beam.is_bent() || !self.is_inside_stop(&axes, alpha) {
            return None;
        }
        let (Some((left, right)), Some((top, bottom))) =
            (self.lit(0, &axes[0], alpha.x), self.lit(1, &axes[1], alpha.y))
        else {
            return Some(None);
        };
        for (axis, (first, end)) in [(left, right), (top, bottom)].into_iter().enumerate() {
            scratch.edges[axis].clear();
            for edge in first..=end {
                scratch.edges[axis].push(axes[axis].place(edge as f64, alpha[axis], by_shift, f64::INFINITY));
            }
        }
        // Widen the spot by the blur.
        let along = 0.5 * (alpha.x * axes[0].per_slope + alpha.y * axes[1].per_slope);
        let variance = along * along * blur.sigma_px * blur.sigma_px;
        let sigma_mm = (self.spot_mm * self.spot_mm + variance).sqrt();
        let by_alpha = 2.0 * variance / (sigma_mm * (alpha.x + alpha.y));
        let (by_spot, by_blur) = (self.spot_mm / sigma_mm, along * along * blur.sigma_px / sigma_mm);
        let tables = ladder.nearest(sigma_mm);
        let image = LensletImage { tables, spot_mm: sigma_mm, more_mm: sigma_mm - tables.sigma_mm, ..*self };
        let [column, row] = [left, top].map(|first| first as u32);
        let patch = Patch { column, row, columns: (right - left) as u32, rows: (bottom - top) as u32 };
        scratch.pixels.clear();
        scratch.pixels.resize((patch.columns * patch.rows) as usize, [0.0; QUANTITIES]);
        T::integrate::<QUANTITIES>(&image, scratch, Cut::none(patch.columns, alpha, line.centre));
        for pixel in &mut scratch.pixels {
            for number in pixel.iter_mut() {
                *number *= blur.share;
            }
            let by_size = pixel[4];
            pixel[3] += by_size * by_alpha;
            (pixel[4], pixel[7]) = (by_size * by_spot, by_size * by_blur);
        }
        Some(Some(patch))
    }

    /// Growth from the array to the sensor along both axes, px a mm, and its mean.
    #[inline(always)]
    pub(super) fn growths(axes: &[Axis; 2], alpha: DVec2) -> ([f64; 2], f64) {
        let growths = [0, 1].map(|n| axes[n].slope / alpha[n]);
        (growths, 0.5 * (growths[0] + growths[1]))
    }

    /// Scale of a lenslet's picture, px on the sensor a mm on the array.
    #[inline(always)]
    pub(super) fn scale(&self, line: &LensletLine) -> f64 {
        let (axes, alpha) = self.axes(line);
        Self::growths(&axes, alpha).1.abs()
    }

    /// The departure of a lenslet from a picture of another scale, None from its own. The outer option is None if the
    /// picture cannot serve.
    #[inline(always)]
    fn depart(
        &self,
        (growths, stop): ([f64; 2], Stop),
        (scale, blur_px): (f64, f64),
        is_whole: bool,
    ) -> Option<Option<Departure>> {
        let mean = 0.5 * (growths[0] + growths[1]);
        let own = scale.copysign(mean);
        if growths.iter().all(|growth| (own / growth - 1.0).abs() < NO_GROWTH) {
            return Some(None);
        }
        let View { cell_radius, corner, pictures, .. } = self.view;
        let most = GROWTH.min(GROWTH_PX / (cell_radius * mean.abs()));
        if (mean / own - 1.0).abs() > most || !pictures.as_ref()?.has(scale, blur_px) {
            return None;
        }
        let departure = Departure::new(growths, own, (stop, !is_whole));
        let edge = (mean.abs() * *corner).as_vec2().to_array();
        (departure.largest(edge) < FARTHEST_PX).then_some(Some(departure))
    }

    /// Fills the scratch's places with light, and with its derivatives by place if N asks for them. The outer option is
    /// None if no picture serves the lenslet.
    #[inline(always)]
    pub(super) fn even<const N: usize>(
        &self,
        (blur, ladder): (&SensorBlur, &Ladder<T>),
        line: &LensletLine,
        scratch: &mut Scratch,
    ) -> Option<Option<Patch>> {
        let (pictures, (axes, alpha)) = (self.view.pictures.as_ref()?, self.axes(line));
        let (is_whole, is_round) = (self.is_inside_stop(&axes, alpha), self.view.has_round_stop);
        let is_exact = self.view.is_exact && !self.view.follows_waves();
        if self.beam.is_bent() || alpha.x == 0.0 || alpha.y == 0.0 || is_exact && !is_whole {
            return None;
        }
        let (growths, growth) = Self::growths(&axes, alpha);
        let scale = growth.abs();
        let blur_px = |scale: f64| blur.sigma_px.hypot(self.spot_mm * scale);
        if !pictures.has(scale, blur_px(scale)) {
            return None;
        }
        let (Some(across), Some(down)) = (self.lit(0, &axes[0], alpha.x), self.lit(1, &axes[1], alpha.y)) else {
            return Some(None);
        };
        let Scratch { even, places, .. } = scratch;
        // Take the last picture, or that in the middle, which may serve all lenslets, or one of the own scale.
        let middle = [0, 1].map(|n| axes[n].zero + growths[n] * axes[n].chief);
        let half = (self.view.optics.half_aperture_mm * axes[0].slope.abs() - blur.rim_px()) as f32;
        let stop = Stop { middle: [0, 1].map(|n| (axes[n].zero - middle[n]) as f32), half, is_round };
        let depart = |other: f64| self.depart((growths, stop), (other, blur_px(other)), is_whole);
        let middles = (even.middle != even.scale).then_some(even.middle);
        let mut candidates = [Some(even.scale), middles, Some(scale)].into_iter().flatten();
        let (taken, departure) = candidates.find_map(|other| Some((other, depart(other)?)))?;
        if taken != even.scale {
            even.scale = taken;
            pictures.fill(ladder, taken, blur_px(taken), &mut even.picture);
        }

        // Find the pixels within the picture, and where they lie between its nodes.
        let within = |axis: usize, (first, end): (i64, i64)| {
            let half = even.picture.half[axis] as f64;
            let (first, end) =
                (first.max((middle[axis] - half).ceil() as i64), end.min((middle[axis] + half).ceil() as i64 - 1));
            (first < end).then_some((first, end))
        };
        let (Some((left, right)), Some((top, bottom))) = (within(0, across), within(1, down)) else {
            return Some(None);
        };
        let (columns, rows) = ((right - left) as usize, (bottom - top) as usize);
        let first = [left as f64 + 0.5 - middle[0], top as f64 + 0.5 - middle[1]];
        if N <= LIGHT && is_whole && departure.is_none() {
            even.read::<1>(first, [columns, rows]);
        } else {
            even.read::<NUMBERS>(first, [columns, rows]);
        }
        let factors = self.factors(blur, (&axes, alpha), stop);

        places.clear();
        places.resize(columns * rows, [0.0; PLACES]);
        if N <= LIGHT && is_whole && departure.is_none() {
            let lit = places.iter_mut().zip(&even.means[0]).filter(|(_, mean)| **mean > DARK);
            lit.for_each(|(out, mean)| out[0] = factors.scale * mean);
        } else {
            let rim = StopRim::new(is_whole, is_round, factors.variance);
            factors.light((even, departure.as_ref()), rim, places);
        }
        let [column, row] = [left, top].map(|first| first as u32);
        Some(Some(Patch { column, row, columns: columns as u32, rows: rows as u32 }))
    }

    #[inline(always)]
    fn factors(&self, blur: &SensorBlur, (axes, alpha): (&[Axis; 2], DVec2), stop: Stop) -> Factors {
        let [x, y] = axes;
        let half = self.view.optics.half_aperture_mm;
        let by_m = [0, 1].map(|n| (axes[n].kappa / alpha[n]) as f32);
        let by_alpha = [0, 1].map(|n| (-axes[n].kappa * axes[n].chief / (alpha[n] * alpha[n])) as f32);
        let (chief_by, alpha_by) = (&self.beam.chief_by, &self.beam.alpha_by);
        Factors {
            scale: (blur.share * (x.per_slope * y.per_slope).abs() / self.view.stop_mm2) as f32,
            growth: (x.gamma * x.per_slope + y.gamma * y.per_slope) as f32,
            moves: [[by_m[0], 0.0], [0.0, by_m[1]], by_alpha],
            grows: (-x.kappa * x.per_slope / alpha.x) as f32,
            stop_moves: [x.gamma as f32, y.gamma as f32],
            stop_grows: (-half * x.gamma * x.slope.signum()) as f32,
            stop,
            variance: blur.kernel_px2() as f32,
            to_place: [0, 1, 2].map(|n| [chief_by[n].x as f32, chief_by[n].y as f32, alpha_by[n] as f32]),
        }
    }
}

impl Factors {
    /// The light of pixels and its derivatives by place.
    #[inline(never)]
    fn light(&self, light: (&PictureMeans, Option<&Departure>), rim: StopRim, out: &mut [[f32; PLACES]]) {
        fastest(
            #[inline(always)]
            || self.fill(light, rim, out),
        );
    }

    #[inline(always)]
    fn fill(
        &self,
        (PictureMeans { means, places, .. }, departure): (&PictureMeans, Option<&Departure>),
        rim: StopRim,
        out: &mut [[f32; PLACES]],
    ) {
        let v = self.variance;
        let (most, least) = (MOST_SHIFT * v.sqrt(), LEAST_VARIANCE);
        for (first, out) in (0..).step_by(LANES).zip(out.chunks_mut(LANES)) {
            let eight = |numbers: &Vec<f32>| -> [f32; LANES] {
                numbers[first..first + LANES].try_into().expect("eight pixels")
            };
            let (means, places) = (means.each_ref().map(eight), places.each_ref().map(eight));
            // The slope and the curvature of the logarithm of the mean give the bump.
            let (mut bumps, mut logs) = (Bumps { places, widths: [[0.0; LANES]; 3] }, [[0f32; LANES]; 5]);
            for n in 0..LANES {
                let [mean, x, y, xx, xy, yy] = [0, 1, 2, 3, 4, 5].map(|number| means[number][n]);
                let per_mean = 1.0 / mean.max(DARK);
                let (x, y) = (x * per_mean, y * per_mean);
                let (xx, xy, yy) = (xx * per_mean - x * x, xy * per_mean - x * y, yy * per_mean - y * y);
                (logs[0][n], logs[1][n], logs[2][n], logs[3][n], logs[4][n]) = (x, y, xx, xy, yy);
                bumps.places[0][n] += (v * x).max(-most).min(most);
                bumps.places[1][n] += (v * y).max(-most).min(most);
                bumps.widths[0][n] = (1.0 + v * xx).max(least);
                bumps.widths[1][n] = v * xy;
                bumps.widths[2][n] = (1.0 + v * yy).max(least);
            }
            let moved = if let Some(departure) = departure { departure.follow(&bumps, &means, v) } else { means };
            let (mut middles, mut wide) = (bumps.places, bumps.widths);
            for n in 0..LANES {
                middles[0][n] -= self.stop.middle[0];
                middles[1][n] -= self.stop.middle[1];
                (wide[0][n], wide[1][n], wide[2][n]) = (v * wide[0][n], v * wide[1][n], v * wide[2][n]);
            }
            let passed = rim.passed(self.stop.half, &middles, &wide);
            let mut numbers = [[0f32; LANES]; PLACES];
            for n in 0..LANES {
                let (mean, slope, xx, yy) = (moved[0][n], [moved[1][n], moved[2][n]], moved[3][n], moved[5][n]);
                let q = [places[0][n], places[1][n]];
                let [log_x, log_y, log_xx, log_xy, log_yy] = [0, 1, 2, 3, 4].map(|number| logs[number][n]);
                let (share, by_half) = (passed.share[n], passed.by_half[n]);
                let by_u = [passed.by_middle[0][n], passed.by_middle[1][n]];
                let (of_mean, of_share) = (self.scale * share, self.scale * mean);
                let light = of_mean * mean;
                // By m along x, m along y and alpha: the picture moves, and the bump with it.
                let by = |[x, y]: [f32; 2]| {
                    let bump = [-v * (log_xx * x + log_xy * y), -v * (log_xy * x + log_yy * y)];
                    -of_mean * (slope[0] * x + slope[1] * y) + of_share * (by_u[0] * bump[0] + by_u[1] * bump[1])
                };
                let by_x = by(self.moves[0]) - of_share * by_u[0] * self.stop_moves[0];
                let by_y = by(self.moves[1]) - of_share * by_u[1] * self.stop_moves[1];
                let growth = q[0] * slope[0] + q[1] * slope[1] + v * (xx + yy);
                let bump = [log_x + q[0] * log_xx + q[1] * log_xy, log_y + q[0] * log_xy + q[1] * log_yy];
                let by_alpha = by(self.moves[2])
                    - self.grows * (of_mean * growth + v * of_share * (by_u[0] * bump[0] + by_u[1] * bump[1]))
                    + of_share * by_half * self.stop_grows
                    + light * self.growth;
                let lit = if means[0][n] > DARK { 1.0 } else { 0.0 };
                let place = |[x, y, alpha]: [f32; 3]| lit * (x * by_x + y * by_y + alpha * by_alpha);
                numbers[0][n] = lit * light;
                numbers[1][n] = place(self.to_place[0]);
                numbers[2][n] = place(self.to_place[1]);
                numbers[3][n] = place(self.to_place[2]);
            }
            for (n, out) in out.iter_mut().enumerate() {
                *out = [numbers[0][n], numbers[1][n], numbers[2][n], numbers[3][n]];
            }
        }
    }
}
