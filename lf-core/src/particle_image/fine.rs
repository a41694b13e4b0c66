//! A lenslet's image of a particle on a blurred sensor.
//!
//! A pixel counts the light around it with a kernel. It is made of two: a narrow one, K, about the pixels of a finer
//! sensor ([`FineSensor`]), and the rest, which smooths the light of that sensor. Seen through the lenslet, K lies in
//! the stop, beside the stop S itself and the lenslet's cell H:
//!
//! ```text
//! light = 1/A int S(U) H(hit(U) - c) K(U) dU
//! ```
//!
//! The mean M of H over K comes from the tables of the cell, for a spot that K widens on the array. Where rays bend, K
//! is an ellipse there, and what it is wider than a circle spreads M like heat. The product H K is a small bump. Its
//! middle and variance follow from M (v is the variance of K, derivatives are by the place in the stop):
//!
//! ```text
//! middle = U + v grad ln M,   variance = v + v^2 grad grad ln M
//! light  = M area(pixel) / A * (share of a normal bump of this middle and variance that lies inside the stop)
//! ```
//!
//! This errs with the square of v, and v is small. So all stops, all cells, straight rays and bent ones are one case.

use super::axis::Axis;
use super::beam::{TERMS, curvature_of_terms, sum_of_terms};
use super::cell_surface::Ladder;
use super::fine_light::FineLight;
use super::fine_sensor::FineSensor;
use super::inside::{Eight, LEAST_VARIANCE, Passed, StopRim};
use super::lenslet_image::{LensletImage, Listed, Patch, Scratch};
use super::lenslet_lines::LensletLine;
use super::picture_means::PictureMeans;
use super::pictures::{LANES, Pictures};
use super::quantities::{LIGHT, PLACES, QUANTITIES};
use super::sensor_blur::SensorBlur;
use super::spots::Spots;
use crate::simd::fastest;
use glam::DVec2;

/// A place with a smaller mean of the cell is dark.
pub(super) const DARK: f32 = 1e-5;
/// The middle of the bump stays within this many standard deviations of K.
pub(super) const MOST_SHIFT: f32 = 3.0;
/// Reach of spots and of K, in their standard deviations.
const REACH: f32 = 3.5;
/// Largest difference of the scales of a lenslet and its picture, as a share.
const ALIKE: f64 = 0.005;
/// Largest correction of the variance of a spot, over the variance.
const MOST_STRETCH: f32 = 0.6;

/// A lenslet. Places in the stop count half apertures, those on the array are from the lenslet's centre, mm.
struct Lenslet {
    /// Places in the stop of the first finer pixel, and the way to the next one.
    first: DVec2,
    step: DVec2,
    chief: DVec2,
    alpha: DVec2,
    /// The rest of the hits of bent rays.
    bend: Option<[[f32; TERMS]; 2]>,
    rim: StopRim,
    rim_at: f32,
    /// The variance of K along both axes.
    kernel: [f32; 2],
    /// Half sides of the box around the cell, mm.
    corner: [f32; 2],
    /// Light passes the stop within these places.
    inside: [f32; 2],
    /// From a mean to light.
    scale: f32,
    /// Motions by m, alpha and the lattice's shift along both axes: of the place in the stop, plain and by the place,
    /// and growth of the light with alpha.
    stop_by_m: [f32; 2],
    stop_by_shift: [f32; 2],
    half: f32,
    growth: f32,
    /// Growth of the spot's variance with alpha.
    spreads: f32,
    spot: f32,
    to_place: [[f32; 3]; 3],
    by_size: [f32; 2],
    /// Variance of the spot, mm^2.
    spot_mm2: f32,
    waves: Option<Waves>,
}

/// Numbers of a lenslet that shows Fresnel's pattern.
struct Waves {
    /// Scale of the lenslet's picture, px on the sensor a mm on the array; None without one.
    picture: Option<f32>,
    /// Variance on the array of the middle of the far field, mm^2.
    middle_mm2: f32,
    /// From the curvature of a mean to its derivative by the blur, mm^2/px.
    by_blur: f32,
}

/// The cell and the bumps at eight places in the stop.
struct Seen {
    mean: Eight,
    /// The slope of its logarithm on the array, and the curvature: first along u by x and by y, then along v.
    slopes: [Eight; 2],
    bends: [Eight; 4],
    /// Middles of the bumps, and their variances: along u, mixed, and along v.
    middles: [Eight; 2],
    widths: [Eight; 3],
}

impl<T: Listed> LensletImage<'_, T> {
    /// Finds the light of a lenslet's pixels and its first N derivatives by place, size, shift and blur.
    #[inline(always)]
    pub(super) fn blurred<const N: usize>(
        &self,
        (blur, ladder): (&SensorBlur, &Ladder<T>),
        (sigma_mm, by_shift): (f64, f64),
        line: &LensletLine,
        scratch: &mut Scratch,
    ) -> Option<Patch> {
        let sensor = &blur.fine;
        let (axes, alpha) = self.axes(line);
        let has_waves = self.view.follows_waves();
        // Light beyond the sensor's edges comes back with the rest of the blur.
        let own_px = if has_waves { blur.sigma_px } else { sensor.variance.sqrt() / sensor.parts as f64 };
        let around = Some((own_px, sensor.reach));
        let across = self.lit_around(0, &axes[0], alpha.x, around)?;
        let down = self.lit_around(1, &axes[1], alpha.y, around)?;
        let first = [across.0, down.0];
        let [columns, rows] = [across, down].map(|(first, end)| (end - first) as usize);
        let mut lenslet = self.lenslet((blur.share, sensor), (&axes, alpha), (first, by_shift), sigma_mm);
        if let Some(pictures) = self.view.pictures.as_ref().filter(|_| has_waves) {
            let growth = Self::growths(&axes, alpha).1.abs();
            let of_picture = self.find_picture((blur, growth), (pictures, ladder), &mut scratch.even);
            lenslet.follow_waves((blur, pictures.fringes_px()), growth, of_picture);
        }
        self.fill::<N>(&lenslet, ladder, (sensor, [columns, rows]), scratch);
        let wide = [columns + 2 * sensor.reach, rows + 2 * sensor.reach];
        sensor.smooth(&mut scratch.fine, wide[1], N > PLACES && !has_waves);
        self.hand_out::<N>((first, sensor.reach as i64), wide, scratch)
    }

    #[inline(always)]
    fn lenslet(
        &self,
        (share, sensor): (f64, &FineSensor),
        (axes, alpha): (&[Axis; 2], DVec2),
        (first, by_shift): ([i64; 2], f64),
        sigma_mm: f64,
    ) -> Lenslet {
        let Self { view, beam, spot_mm: spot, .. } = *self;
        let half = view.optics.half_aperture_mm;
        let parts = sensor.parts as f64;
        let per_slope = DVec2::new(axes[0].per_slope, axes[1].per_slope);
        let step = -per_slope / parts;
        let place = |n: usize| (axes[n].zero - first[n] as f64 - 0.5 / parts) * per_slope[n];
        let chief = DVec2::new(axes[0].chief, axes[1].chief);
        let centre = DVec2::new(axes[0].centre, axes[1].centre);
        let kernel = sensor.variance * step * step / (half * half);
        let inside = DVec2::splat(1.0) + f64::from(REACH) * DVec2::new(kernel.x.sqrt(), kernel.y.sqrt());
        let gamma = DVec2::new(axes[0].gamma, axes[1].gamma) * per_slope;
        let shift = DVec2::splat(by_shift) * per_slope - gamma;
        let numbers = |pair: DVec2| pair.as_vec2().to_array();
        let rest = beam.rest(chief + centre, alpha, half);
        let cuts_nothing = !beam.is_bent() && self.is_inside_stop(axes, alpha);
        let rim = StopRim::new(cuts_nothing, view.has_round_stop, kernel.min_element() as f32);
        Lenslet {
            first: DVec2::new(place(0), place(1)) / half,
            step: step / half,
            chief,
            alpha: alpha * half,
            bend: rest.map(|rest| [0, 1].map(|n| rest.map(|term| term[n] as f32))),
            rim,
            rim_at: 1.0,
            kernel: numbers(kernel),
            corner: numbers(view.corner),
            inside: numbers(inside),
            scale: (share * (per_slope.x * per_slope.y).abs() / (parts * parts) / view.stop_mm2) as f32,
            stop_by_m: numbers(gamma / half),
            stop_by_shift: numbers(shift / half),
            half: half as f32,
            growth: (gamma.x + gamma.y) as f32,
            spreads: (sensor.variance * (alpha * step * step).element_sum() * 0.5) as f32,
            spot: spot as f32,
            to_place: [0, 1, 2]
                .map(|n| [beam.chief_by[n].x as f32, beam.chief_by[n].y as f32, beam.alpha_by[n] as f32]),
            by_size: [beam.beta as f32, (sigma_mm * beam.beta_by_z) as f32],
            spot_mm2: (spot * spot) as f32,
            waves: None,
        }
    }

    /// Finds the picture of a cell whose shadow grows by `growth` px a mm. Gives its own growth, or None without one.
    #[inline(always)]
    fn find_picture(
        &self,
        (blur, growth): (&SensorBlur, f64),
        (pictures, ladder): (&Pictures, &Ladder<T>),
        even: &mut PictureMeans,
    ) -> Option<f64> {
        let blur_px = blur.sigma_px.hypot(self.spot_mm * growth);
        if !pictures.has(growth, blur_px) {
            return None;
        }
        if (growth - even.scale).abs() > ALIKE * growth {
            even.scale = growth;
            pictures.fill(ladder, growth, blur_px, &mut even.picture);
        }
        Some(even.scale)
    }

    /// Fills the finer pixels.
    #[inline(always)]
    fn fill<const N: usize>(
        &self,
        lenslet: &Lenslet,
        ladder: &Ladder<T>,
        (sensor, [columns, rows]): (&FineSensor, [usize; 2]),
        scratch: &mut Scratch,
    ) {
        let Scratch { fine: light, spots, even, .. } = scratch;
        // Waves give the derivative by the blur; else the rest of the blur does.
        let count = if lenslet.waves.is_some() { N } else { N.min(QUANTITIES - 1) };
        light.begin(sensor, [columns, rows], count);
        let mut round = lenslet.find(spots, light, (sensor.parts, [columns, rows]));
        match &lenslet.waves {
            Some(Waves { picture: Some(scale), .. }) => {
                round = sensor.variance as f32 / (scale * scale);
                even.picture.fill_means(*scale, spots);
            }
            waves => {
                let middle = waves.as_ref().map_or(0.0, |waves| waves.middle_mm2);
                T::fill_means(ladder, f64::from(lenslet.spot_mm2 + round + middle).sqrt(), spots);
            }
        }
        lenslet.light::<N>(spots, round);
        for (quantity, numbers) in spots.light.iter().enumerate().take(count) {
            light.set(quantity, &spots.at[..spots.count], numbers);
        }
    }

    /// Hands out the pixels that lie on the sensor. They begin `before` pixels before the first finer one.
    #[inline(always)]
    pub(super) fn hand_out<const N: usize>(
        &self,
        (first, before): ([i64; 2], i64),
        [columns, rows]: [usize; 2],
        scratch: &mut Scratch,
    ) -> Option<Patch> {
        let Scratch { fine, places, pixels, .. } = scratch;
        let on_sensor = |n: usize, count: usize| {
            let first = first[n] - before;
            let end = (first + count as i64).min(self.view.optics.sensor_px[n] as i64);
            (first.max(0) < end).then_some((first.max(0) - first, (end - first.max(0)) as usize))
        };
        let ((left, wide), (top, high)) = (on_sensor(0, columns)?, on_sensor(1, rows)?);
        places.clear();
        pixels.clear();
        if N > PLACES {
            pixels.resize(wide * high, [0.0; QUANTITIES]);
        } else {
            places.resize(wide * high, [0.0; PLACES]);
        }
        for (quantity, light) in fine.pixels.iter().enumerate().take(N) {
            for row in 0..high {
                let light = &light[(top as usize + row) * fine.columns + left as usize..][..wide];
                if N > PLACES {
                    for (pixel, light) in pixels[row * wide..].iter_mut().zip(light) {
                        pixel[quantity] = f64::from(*light);
                    }
                } else {
                    for (pixel, light) in places[row * wide..].iter_mut().zip(light) {
                        pixel[quantity] = *light;
                    }
                }
            }
        }
        let [column, row] = [first[0] - before + left, first[1] - before + top].map(|first| first as u32);
        Some(Patch { column, row, columns: wide as u32, rows: high as u32 })
    }
}

impl Lenslet {
    /// Follows waves, for a shadow that grows by `growth` px a mm, by a picture of this scale.
    fn follow_waves(&mut self, (blur, fringes_px): (&SensorBlur, f64), growth: f64, picture: Option<f64>) {
        let per_growth = if growth.is_finite() { 1.0 / growth } else { 0.0 };
        let square = per_growth * per_growth;
        self.rim_at = 1.0 - (blur.rim_px() * self.step.abs().max_element()) as f32;
        self.corner = self.corner.map(|corner| corner + (fringes_px * per_growth) as f32);
        self.waves = Some(Waves {
            picture: picture.map(|scale| scale as f32),
            middle_mm2: (blur.middle_px2() * square) as f32,
            by_blur: (blur.sigma_px * square) as f32,
        });
    }

    /// Finds the spots and follows their rays to the array. Gives the mean variance of K there, mm^2.
    #[inline(never)]
    fn find(&self, spots: &mut Spots, light: &FineLight, (parts, [columns, rows]): (usize, [usize; 2])) -> f32 {
        let mut round = 0.0;
        spots.begin((rows * parts) * parts * columns.next_multiple_of(LANES));
        fastest(
            #[inline(always)]
            || {
                for row in 0..rows * parts {
                    let v = (self.first[1] + self.step[1] * row as f64) as f32;
                    if !self.is_lit(1, v) {
                        continue;
                    }
                    for part in 0..parts {
                        let start = light.start(row, part);
                        let first = (self.first[0] + self.step[0] * part as f64) as f32;
                        self.add_lit(spots, (first, v), (start as u32, columns), parts as f32);
                    }
                }
                round = self.follow(spots);
            },
        );
        round
    }

    /// Whether straight rays through a place along an axis can meet the cell; all that pass the stop if rays bend.
    #[inline(always)]
    fn is_lit(&self, n: usize, place: f32) -> bool {
        let alpha = self.alpha[n] as f32;
        let hit = self.chief[n] as f32 + alpha * place;
        let wide = self.kernel[n] * alpha * alpha;
        place.abs() < self.inside[n] && (self.bend.is_some() || self.is_on_cell(n, hit, wide))
    }

    /// Whether a spot that K widens by a variance of `wide` touches the cell along an axis.
    #[inline(always)]
    fn is_on_cell(&self, n: usize, hit: f32, wide: f32) -> bool {
        hit.abs() < self.corner[n] + REACH * (self.spot_mm2 + wide).sqrt()
    }

    /// Adds the places of a row that light can reach. They are `parts` finer pixels apart, from the first one on.
    #[inline(always)]
    fn add_lit(&self, spots: &mut Spots, (first, v): (f32, f32), (start, columns): (u32, usize), parts: f32) {
        let step = self.step.x as f32 * parts;
        for column in (0..columns).step_by(LANES) {
            let mut u = [0f32; LANES];
            let mut lit = [false; LANES];
            for k in 0..LANES {
                u[k] = first + step * (column + k) as f32;
                lit[k] = self.is_lit(0, u[k]);
            }
            if self.bend.is_some() {
                let ([x, y], by) = self.hits(&u, &[v; LANES]);
                let [wide_x, wide_y] = self.widths(&by);
                for k in 0..LANES {
                    lit[k] &= self.is_on_cell(0, x[k], wide_x[k]) & self.is_on_cell(1, y[k], wide_y[k]);
                }
            }
            let mut count = spots.count;
            for k in 0..LANES {
                spots.at[count] = start + (column + k) as u32;
                spots.stop[0][count] = u[k];
                spots.stop[1][count] = v;
                count += usize::from(lit[k]);
            }
            spots.count = count;
        }
    }

    /// Variances of K on the array along x and y, mm^2.
    #[inline(always)]
    fn widths(&self, [a, b, c, d]: &[Eight; 4]) -> [Eight; 2] {
        let [kx, ky] = self.kernel;
        let mut wide = [[0f32; LANES]; 2];
        for k in 0..LANES {
            wide[0][k] = kx * a[k] * a[k] + ky * b[k] * b[k];
            wide[1][k] = kx * c[k] * c[k] + ky * d[k] * d[k];
        }
        wide
    }

    /// Follows the rays of all spots to the array. Gives the mean variance of K there, mm^2.
    #[inline(always)]
    fn follow(&self, spots: &mut Spots) -> f32 {
        for list in &mut spots.stop {
            list[spots.count..spots.count + LANES].fill(0.0);
        }
        let mut sum = 0.0;
        for first in (0..spots.room()).step_by(LANES) {
            let range = first..first + LANES;
            let [u, v] = &spots.stop;
            let (u, v): (&Eight, &Eight) =
                (u[range.clone()].try_into().expect("eight spots"), v[range.clone()].try_into().expect("eight spots"));
            let (hits, by) = self.hits(u, v);
            let [wide_x, wide_y] = self.widths(&by);
            sum += (0..LANES).map(|k| wide_x[k] + wide_y[k]).sum::<f32>();
            spots.hit.iter_mut().zip(&hits).for_each(|(list, hits)| list[range.clone()].copy_from_slice(hits));
            spots.by.iter_mut().zip(&by).for_each(|(list, by)| list[range.clone()].copy_from_slice(by));
        }
        0.5 * sum / spots.room().max(1) as f32
    }

    /// Where rays through eight places meet the array, and how that moves with the place.
    #[inline(always)]
    fn hits(&self, u: &Eight, v: &Eight) -> ([Eight; 2], [Eight; 4]) {
        let [chief, alpha] = [self.chief.as_vec2(), self.alpha.as_vec2()];
        let (mut x, mut y, mut by) = ([0f32; LANES], [0f32; LANES], [[0f32; LANES]; 4]);
        for k in 0..LANES {
            (x[k], y[k]) = (chief.x + alpha.x * u[k], chief.y + alpha.y * v[k]);
            (by[0][k], by[3][k]) = (alpha.x, alpha.y);
        }
        if let Some(bend) = &self.bend {
            let [along, across] = self.bend(bend, u, v);
            for k in 0..LANES {
                x[k] += along[0][k];
                y[k] += across[0][k];
                by[0][k] += along[1][k];
                by[1][k] += along[2][k];
                by[2][k] += across[1][k];
                by[3][k] += across[2][k];
            }
        }
        ([x, y], by)
    }

    /// How far rays through eight places land from where straight ones do, along x and y, and how that changes with the
    /// place in the stop. Beside the stop rays bend as at its rim.
    #[inline(always)]
    fn bend(&self, terms: &[[f32; TERMS]; 2], u: &Eight, v: &Eight) -> [[Eight; 3]; 2] {
        let (mut a, mut b) = ([0f32; LANES], [0f32; LANES]);
        if let StopRim::Round(_) = self.rim {
            for k in 0..LANES {
                let inwards = 1.0 / (u[k] * u[k] + v[k] * v[k]).sqrt().max(1.0);
                (a[k], b[k]) = (u[k] * inwards, v[k] * inwards);
            }
        } else {
            for k in 0..LANES {
                (a[k], b[k]) = (u[k].clamp(-1.0, 1.0), v[k].clamp(-1.0, 1.0));
            }
        }
        let mut bent = [[[0f32; LANES]; 3]; 2];
        for (bent, terms) in bent.iter_mut().zip(terms) {
            for k in 0..LANES {
                let (sum, [by_u, by_v]) = sum_of_terms(terms, a[k], b[k]);
                // A finer pixel takes the mean of hits, which their curvature moves.
                let [uu, vv] = curvature_of_terms(terms, a[k], b[k]);
                let mean = 0.5 * (self.kernel[0] * uu + self.kernel[1] * vv);
                bent[0][k] = sum + by_u * (u[k] - a[k]) + by_v * (v[k] - b[k]) + mean;
                bent[1][k] = by_u;
                bent[2][k] = by_v;
            }
        }
        bent
    }

    /// The light of the spots and its derivatives. `round` is the variance of K in their means, mm^2.
    #[inline(never)]
    fn light<const N: usize>(&self, spots: &mut Spots, round: f32) {
        fastest(
            #[inline(always)]
            || self.fill_light::<N>(spots, round),
        );
    }

    #[inline(always)]
    fn fill_light<const N: usize>(&self, spots: &mut Spots, round: f32) {
        let room = spots.room();
        let Spots { stop, by, means, light, .. } = spots;
        for first in (0..room).step_by(LANES) {
            let eight = |list: &Vec<f32>| -> Eight { list[first..first + LANES].try_into().expect("eight spots") };
            let stop = [eight(&stop[0]), eight(&stop[1])];
            let by = [eight(&by[0]), eight(&by[1]), eight(&by[2]), eight(&by[3])];
            let [a, b, c, d, e, f] = means;
            let means = [eight(a), eight(b), eight(c), eight(d), eight(e), eight(f)];
            let numbers = self.eight::<N>((&stop, &by), (&means, round));
            for (list, numbers) in light.iter_mut().zip(&numbers).take(N) {
                list[first..first + LANES].copy_from_slice(numbers);
            }
        }
    }

    /// Finds the mean of the cell and the bumps at eight places.
    #[inline(always)]
    fn seen(&self, (stop, by): (&[Eight; 2], &[Eight; 4]), (means, round): (&[Eight; 6], f32)) -> Seen {
        let [kx, ky] = self.kernel;
        let far = [MOST_SHIFT * kx.sqrt(), MOST_SHIFT * ky.sqrt()];
        let least = [LEAST_VARIANCE * kx, LEAST_VARIANCE * ky];
        let none = [0f32; LANES];
        let mut seen = Seen { mean: none, slopes: [none; 2], bends: [none; 4], middles: [none; 2], widths: [none; 3] };
        for k in 0..LANES {
            let (mean, x, y) = (means[0][k], means[1][k], means[2][k]);
            let (xx, xy, yy) = (means[3][k], means[4][k], means[5][k]);
            let (a, b, c, d) = (by[0][k], by[1][k], by[2][k], by[3][k]);
            // Spread the mean by what K is wider than its round part.
            let most = MOST_STRETCH * (self.spot_mm2 + round);
            let hold = |wide: f32| wide.max(-most).min(most);
            let wide_x = hold(kx * a * a + ky * b * b - round);
            let wide_y = hold(kx * c * c + ky * d * d - round);
            let mixed = hold(kx * a * c + ky * b * d);
            let mean = (mean + 0.5 * (wide_x * xx + wide_y * yy) + mixed * xy).max(0.0);
            // Slope and curvature of the logarithm on the array, then along the stop.
            let per_mean = 1.0 / mean.max(DARK);
            let (gx, gy) = (x * per_mean, y * per_mean);
            let (lxx, lxy, lyy) = (xx * per_mean - gx * gx, xy * per_mean - gx * gy, yy * per_mean - gy * gy);
            let (gu, gv) = (a * gx + c * gy, b * gx + d * gy);
            let (ux, uy) = (a * lxx + c * lxy, a * lxy + c * lyy);
            let (vx, vy) = (b * lxx + d * lxy, b * lxy + d * lyy);
            let (luu, luv, lvv) = (ux * a + uy * c, vx * a + vy * c, vx * b + vy * d);
            let (u, v) = (stop[0][k], stop[1][k]);
            seen.middles[0][k] = u + (kx * gu).max(-far[0]).min(far[0]);
            seen.middles[1][k] = v + (ky * gv).max(-far[1]).min(far[1]);
            seen.widths[0][k] = (kx + kx * kx * luu).max(least[0]);
            seen.widths[1][k] = kx * ky * luv;
            seen.widths[2][k] = (ky + ky * ky * lvv).max(least[1]);
            (seen.mean[k], seen.slopes[0][k], seen.slopes[1][k]) = (mean, gx, gy);
            (seen.bends[0][k], seen.bends[1][k], seen.bends[2][k], seen.bends[3][k]) = (ux, uy, vx, vy);
        }
        seen
    }

    #[inline(always)]
    fn eight<const N: usize>(
        &self,
        (stop, by): (&[Eight; 2], &[Eight; 4]),
        (means, round): (&[Eight; 6], f32),
    ) -> [Eight; QUANTITIES] {
        let [kx, ky] = self.kernel;
        let seen = self.seen((stop, by), (means, round));
        let Passed { share, by_middle, .. } = self.rim.passed(self.rim_at, &seen.middles, &seen.widths);
        let mut numbers = [[0f32; LANES]; QUANTITIES];
        for k in 0..LANES {
            let (mean, share, by_middle) = (seen.mean[k], share[k], [by_middle[0][k], by_middle[1][k]]);
            let lit = if mean > DARK { self.scale } else { 0.0 };
            let (of_mean, of_share) = (lit * share, lit * mean);
            let light = of_mean * mean;
            numbers[0][k] = light;
            if N <= LIGHT {
                continue;
            }
            let (u, v) = (stop[0][k], stop[1][k]);
            let (x, y, xx, yy) = (means[1][k], means[2][k], means[3][k], means[5][k]);
            let (a, b, c, d) = (by[0][k], by[1][k], by[2][k], by[3][k]);
            let [gx, gy] = [seen.slopes[0][k], seen.slopes[1][k]];
            let [ux, uy, vx, vy] = [0, 1, 2, 3].map(|n| seen.bends[n][k]);
            // The light changes as the hit and the place in the stop move.
            let moves = |hit: [f32; 2], stop: [f32; 2]| {
                let hit = [hit[0] + a * stop[0] + b * stop[1], hit[1] + c * stop[0] + d * stop[1]];
                let bump = [stop[0] + kx * (ux * hit[0] + uy * hit[1]), stop[1] + ky * (vx * hit[0] + vy * hit[1])];
                of_mean * (x * hit[0] + y * hit[1]) + of_share * (by_middle[0] * bump[0] + by_middle[1] * bump[1])
            };
            let [mx, my] = self.stop_by_m;
            let by_x = moves([1.0, 0.0], [mx, 0.0]);
            let by_y = moves([0.0, 1.0], [0.0, my]);
            let (on_x, on_y) = (u * self.half, v * self.half);
            let by_alpha = moves([on_x, on_y], [mx * on_x, my * on_y])
                + of_share * self.half * (by_middle[0] * kx * gx + by_middle[1] * ky * gy)
                + of_mean * self.spreads * (xx + yy)
                + light * self.growth;
            for (n, [by_m, by_n, by_spread]) in self.to_place.iter().enumerate() {
                numbers[1 + n][k] = by_m * by_x + by_n * by_y + by_spread * by_alpha;
            }
            if N > PLACES {
                let by_spot = of_mean * self.spot * (xx + yy);
                let [sx, sy] = self.stop_by_shift;
                numbers[3][k] += self.by_size[1] * by_spot;
                numbers[4][k] = self.by_size[0] * by_spot;
                numbers[5][k] = moves([-1.0, 0.0], [sx, 0.0]);
                numbers[6][k] = moves([0.0, -1.0], [0.0, sy]);
                numbers[7][k] = self.waves.as_ref().map_or(0.0, |waves| of_mean * waves.by_blur * (xx + yy));
            }
        }
        numbers
    }
}
