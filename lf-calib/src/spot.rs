//! One small spot of light read from the pixels: its place, its light, and how well the place is known.
//!
//! The spot is a flat square of a known width, blurred by what glows, by a Gaussian and by the pixels. A centroid would have to choose
//! between the light that a narrow window cuts and the noise that a wide one lets in; a fit of the profile does neither.

use glam::DVec2;
use nalgebra::{Matrix4, Vector4};
use ndarray::ArrayView2;

/// Narrower spots than this, px, are read as if this wide: between pixels no place could be told.
const LEAST_PX: f64 = 0.05;
/// Pixels read around a spot: its half width, so many deviations of the blur, and this many px.
const REACH_SIGMA: f64 = 2.0;
const REACH_PX: f64 = 1.2;
/// Amplitude of what sampling leaves: of wide spots, read from discs without noise 0.0006 to 0.0024 px; and what a spot
/// without width would have more, times the contrast that it has at the pixels' frequency.
const SAMPLING_PX: f64 = 0.0015;
const NARROW_PX: f64 = 0.017;
/// Steps of Gauss and Newton; each squares the error, which starts at some tenths of the width.
const STEPS: usize = 12;
/// A step below this ends the fit, px.
const SMALL_STEP_PX: f64 = 1e-4;
/// Radius of the window of a first look, in deviations of the whole spot, and in px at least.
const LOOK_SIGMA: f64 = 2.0;
const LOOK_PX: f64 = 2.0;

/// How a spot should look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shape {
    /// Width of the flat square, px.
    pub width_px: f64,
    /// Standard deviation of what glows along an axis, as an even square of as much: discs differ from it by little, px.
    pub disc_px: f64,
    /// Standard deviation of what else blurs it, without the pixels, px.
    pub sigma_px: f64,
}

/// What a spot says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reading {
    /// Middle, px.
    pub place_px: DVec2,
    /// Standard uncertainty of each coordinate by what the profile leaves of the pixels, px.
    pub uncertainty_px: f64,
    /// Counts of its light.
    pub light: f64,
    /// What the profile leaves of the pixels, sum of squares.
    pub left: f64,
    /// Share of the variance of the pixels that the profile explains.
    pub explained: f64,
}

/// Error function of the normal distribution, right to 2e-7: Abramowitz & Stegun (1964), 7.1.26.
fn normal(z: f64) -> f64 {
    let x = z.abs() * std::f64::consts::FRAC_1_SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let sum =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let tail = 0.5 * sum * (-x * x).exp();
    if z > 0.0 { 1.0 - tail } else { tail }
}

impl Shape {
    fn usable(self) -> Self {
        Self {
            width_px: self.width_px.max(LEAST_PX),
            disc_px: self.disc_px.max(LEAST_PX),
            sigma_px: self.sigma_px.max(LEAST_PX),
        }
    }

    /// Standard deviation of the whole spot along an axis, pixels and all, px.
    pub fn deviation_px(self) -> f64 {
        ((self.width_px * self.width_px + 1.0) / 12.0 + self.disc_px.powi(2) + self.sigma_px.powi(2)).sqrt()
    }

    /// Share of the light of a line that falls on the pixel whose middle is `u` from the spot's, and its slope.
    fn share(self, u: f64) -> (f64, f64) {
        let (w, d, s) = (self.width_px, 12f64.sqrt() * self.disc_px, self.sigma_px);
        let (mut value, mut slope) = (0.0, 0.0);
        // Three squares over one another: differences, over the three widths, of the Gaussian integrated three times.
        for n in 0..8 {
            let side = |bit: u32| if n >> bit & 1 == 0 { 0.5 } else { -0.5 };
            let sign = 8.0 * side(0) * side(1) * side(2);
            let z = (u + side(0) + side(1) * w + side(2) * d) / s;
            let (below, density) = (normal(z), (-0.5 * z * z).exp() * 0.398_942_280_401_432_7);
            value += sign * s * s * 0.5 * ((z * z + 1.0) * below + z * density);
            slope += sign * s * (z * below + density);
        }
        (value / (w * d), slope / (w * d))
    }

    /// What sampling may do to a place read, px: the profile is not quite the spot's, and the narrower the spot, the more of
    /// that shows in where it is between pixels.
    pub fn sampling_px(self) -> f64 {
        let variance = self.width_px.powi(2) / 12.0 + self.disc_px.powi(2) + self.sigma_px.powi(2);
        SAMPLING_PX + NARROW_PX * (-2.0 * std::f64::consts::PI.powi(2) * variance).exp()
    }

    /// Half width of the pixels read, px.
    pub fn reach_px(self) -> f64 {
        0.5 * self.width_px + REACH_SIGMA * self.disc_px.hypot(self.sigma_px) + REACH_PX
    }
}

/// Columns or rows whose middles lie within `reach` of `centre`; none if one of them is outside the image.
fn within(centre: f64, reach: f64, size: usize) -> Option<std::ops::Range<usize>> {
    let (first, last) = ((centre - reach - 0.5).ceil(), (centre + reach - 0.5).floor());
    (first >= 0.0 && last < size as f64 && last >= first).then(|| first as usize..last as usize + 1)
}

/// A first look: the mean place of what is brighter than the window's rim, the window following it. None if it leaves the
/// image or goes farther than `farthest_px`.
pub(crate) fn look(image: ArrayView2<f32>, shape: Shape, from_px: DVec2, farthest_px: f64) -> Option<DVec2> {
    let reach = (LOOK_SIGMA * shape.deviation_px()).max(LOOK_PX);
    let mut centre = from_px;
    for _ in 0..STEPS {
        let (rows, columns) = (within(centre.y, reach, image.nrows())?, within(centre.x, reach, image.ncols())?);
        let mut floor = f64::INFINITY;
        for row in rows.clone() {
            for column in columns.clone() {
                floor = floor.min(f64::from(image[(row, column)]));
            }
        }
        let (mut sum, mut light) = (DVec2::ZERO, 0.0);
        for row in rows {
            for column in columns.clone() {
                let count = f64::from(image[(row, column)]) - floor;
                if count.is_finite() {
                    let place = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                    let weight = count * (-0.5 * (place - centre).length_squared() * 4.0 / (reach * reach)).exp();
                    sum += weight * place;
                    light += weight;
                }
            }
        }
        if light <= 0.0 {
            return None;
        }
        let next = sum / light;
        let step = next.distance(centre);
        centre = next;
        if centre.distance(from_px) > farthest_px {
            return None;
        }
        if step < 0.02 {
            break;
        }
    }
    Some(centre)
}

/// Least squares of the pixels around a place against floor + light x profile. None if the window leaves the image, if
/// the place goes farther than `farthest_px`, or if there is no light. Pixels that are not finite are left out.
pub(crate) fn read(image: ArrayView2<f32>, shape: Shape, from_px: DVec2, farthest_px: f64) -> Option<Reading> {
    let shape = shape.usable();
    let reach = shape.reach_px();
    let (rows, columns) = (within(from_px.y, reach, image.nrows())?, within(from_px.x, reach, image.ncols())?);
    let mut place = from_px;
    let mut along = Vec::with_capacity(columns.len());
    for step_number in 0..STEPS {
        along.clear();
        along.extend(columns.clone().map(|column| shape.share(column as f64 + 0.5 - place.x)));
        let (mut matrix, mut right) = (Matrix4::zeros(), Vector4::zeros());
        let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for row in rows.clone() {
            let (across, across_slope) = shape.share(row as f64 + 0.5 - place.y);
            for (column, (value, slope)) in columns.clone().zip(&along) {
                let pixel = f64::from(image[(row, column)]);
                if !pixel.is_finite() {
                    continue;
                }
                let line = Vector4::new(1.0, value * across, -slope * across, -value * across_slope);
                matrix.ger(1.0, &line, &line, 1.0);
                right += pixel * line;
                count += 1.0;
                sum += pixel;
                squares += pixel * pixel;
            }
        }
        if count < 6.0 {
            return None;
        }
        let factors = matrix.cholesky()?;
        let solution = factors.solve(&right);
        let light = solution[1];
        if light.is_nan() || light <= 0.0 {
            return None;
        }
        let step = DVec2::new(solution[2], solution[3]) / light;
        // A long step is a bad linearisation: it says which way, not how far.
        let step = step.clamp_length_max(0.5 * shape.deviation_px());
        if step.length() < SMALL_STEP_PX || step_number + 1 == STEPS {
            let left = (squares - solution.dot(&right)).max(0.0);
            let variance = squares - sum * sum / count;
            let covariance = factors.inverse() * (left / (count - 4.0));
            let uncertainty = (0.5 * (covariance[(2, 2)] + covariance[(3, 3)])).sqrt() / light;
            let explained = if variance > 0.0 { 1.0 - left / variance } else { 0.0 };
            return Some(Reading { place_px: place + step, uncertainty_px: uncertainty, light, left, explained });
        }
        place += step;
        if !place.is_finite() || place.distance(from_px) > farthest_px {
            return None;
        }
    }
    None
}

/// Counts of the light of a spot at a known place, above the window's floor: least squares, and so below 0 by chance. None
/// if the window leaves the image.
pub(crate) fn light(image: ArrayView2<f32>, shape: Shape, place_px: DVec2) -> Option<f64> {
    let shape = shape.usable();
    let reach = shape.reach_px();
    let (rows, columns) = (within(place_px.y, reach, image.nrows())?, within(place_px.x, reach, image.ncols())?);
    let along: Vec<f64> = columns.clone().map(|column| shape.share(column as f64 + 0.5 - place_px.x).0).collect();
    let (mut count, mut profile, mut squares, mut sum, mut mixed) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for row in rows {
        let across = shape.share(row as f64 + 0.5 - place_px.y).0;
        for (column, value) in columns.clone().zip(&along) {
            let (pixel, value) = (f64::from(image[(row, column)]), value * across);
            if pixel.is_finite() {
                count += 1.0;
                profile += value;
                squares += value * value;
                sum += pixel;
                mixed += pixel * value;
            }
        }
    }
    let spread = squares - profile * profile / count;
    (spread > 0.0).then(|| (mixed - sum * profile / count) / spread)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// A square of `width` and a disc of `radius` one over the other, by a fine sum over both, in pixels.
    fn spot(place: DVec2, width: f64, radius: f64, light: f64) -> Array2<f32> {
        const FINE: usize = 60;
        let mut image = Array2::<f64>::zeros((17, 17));
        let part = |n: usize| (n as f64 + 0.5) / FINE as f64 - 0.5;
        let disc: Vec<DVec2> = (0..FINE * FINE)
            .map(|n| 2.0 * radius * DVec2::new(part(n % FINE), part(n / FINE)))
            .filter(|d| d.length() <= radius)
            .collect();
        let edge = |pixel: usize, low: f64| (low + width).min(pixel as f64 + 1.0) - low.max(pixel as f64);
        for d in &disc {
            let low = place + *d - 0.5 * width;
            for row in 0..17 {
                let high = edge(row, low.y);
                for column in 0..17 {
                    image[(row, column)] += high.max(0.0) * edge(column, low.x).max(0.0);
                }
            }
        }
        image.mapv(|v| (v * light / (width * width * disc.len() as f64)) as f32)
    }

    #[test]
    fn the_normal_distribution_at_known_places() {
        for (z, wanted) in [(0.0, 0.5), (1.0, 0.841_344_746), (-1.959_963_985, 0.025), (8.0, 1.0)] {
            assert!((normal(z) - wanted).abs() < 2e-7, "{z}");
        }
    }

    #[test]
    fn shares_sum_to_one_and_have_their_slope() {
        let shape = Shape { width_px: 2.3, disc_px: 0.4, sigma_px: 0.3 };
        for phase in [0.0, 0.3, 0.77] {
            let sum: f64 = (-8..9).map(|n| shape.share(f64::from(n) + phase).0).sum();
            assert!((sum - 1.0).abs() < 1e-6);
            let slope = (shape.share(phase + 1e-4).0 - shape.share(phase - 1e-4).0) / 2e-4;
            assert!((slope - shape.share(phase).1).abs() < 1e-4);
        }
    }

    // A plain centroid of such spots is off by up to a tenth of a pixel, and by where the spot is between pixels.
    #[test]
    fn places_are_unbiased_wherever_a_spot_is_between_pixels() {
        for (width, radius) in [(1.07, 0.35), (1.6, 0.5), (3.3, 1.1), (2.0, 0.1)] {
            let shape = Shape { width_px: width, disc_px: 0.5 * radius, sigma_px: 0.0 };
            let mut worst = 0.0f64;
            for n in 0..49 {
                let place = DVec2::new(8.0 + (n % 7) as f64 / 7.0, 8.0 + (n / 7) as f64 / 7.0);
                let image = spot(place, width, radius, 1000.0);
                let from = look(image.view(), shape, place + DVec2::new(1.2, -0.7), 3.0).unwrap();
                assert!(from.distance(place) < 0.5, "{from} for {place}");
                let found = read(image.view(), shape, from, 2.0).unwrap();
                worst = worst.max((found.place_px - place).abs().max_element());
                assert!((found.light / 1000.0 - 1.0).abs() < 0.06, "{}", found.light);
            }
            println!("{width} {radius} {worst}");
            assert!(worst < 0.01, "{width} {radius}: {worst}");
        }
    }

    #[test]
    fn the_stated_uncertainty_is_what_noise_does() {
        let shape = Shape { width_px: 1.5, disc_px: 0.3, sigma_px: 0.0 };
        let (mut square, mut stated) = (0.0, 0.0);
        const SPOTS: usize = 400;
        let mut state = 5u64;
        let mut normal = || {
            (0..12)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 11) as f64 / (1u64 << 53) as f64
                })
                .sum::<f64>()
                - 6.0
        };
        for n in 0..SPOTS {
            let place = DVec2::new(8.0 + (n % 20) as f64 / 20.0, 8.0 + (n / 20) as f64 / 20.0);
            let image = spot(place, 1.5, 0.6, 1000.0).mapv(|v| v + (12.0 * normal()) as f32 + 40.0);
            let found = read(image.view(), shape, place, 2.0).unwrap();
            square += found.place_px.distance_squared(place) / 2.0;
            stated += found.uncertainty_px.powi(2);
        }
        let ratio = (square / stated).sqrt();
        assert!((0.85..1.15).contains(&ratio), "{ratio}");
    }

    #[test]
    fn no_light_and_no_room_are_no_reading() {
        let shape = Shape { width_px: 1.5, disc_px: 0.3, sigma_px: 0.0 };
        let dark = Array2::<f32>::zeros((17, 17));
        assert!(read(dark.view(), shape, DVec2::splat(8.5), 2.0).is_none());
        let image = spot(DVec2::splat(8.5), 1.5, 0.6, 1000.0);
        assert!(read(image.view(), shape, DVec2::new(1.0, 8.0), 2.0).is_none());
        assert!(look(image.view(), shape, DVec2::new(1.0, 8.0), 2.0).is_none());
    }
}
