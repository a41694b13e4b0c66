//! The shape of the stop's image under a lenslet: a disc or a square, blurred by a Gaussian.
//!
//! The light inside the rim need not be even. It is a sum of even powers of the distance from the centre (disc), or
//! from the middle line (square), over the half width; outside it is 0. Squares have sides along x and y, and their
//! light is averaged over the pixel. Discs take the pixel as part of the Gaussian: its standard deviation is 0.29 px.
//! On discs of 3 px and more this moves the width by less than 0.01 px.

use glam::DVec2;
use lf_core::camera::Aperture;

/// Reach of the blur in standard deviations.
const REACH: f64 = 5.0;
/// Steps of the table for each standard deviation. Linear interpolation is off by a thousandth of the light.
const PER_SIGMA: f64 = 8.0;
/// Intervals of Simpson's rule over twice the reach. The integral over the blur is exact to 1e-6.
const INTERVALS: usize = 48;

/// The blurred powers of one shape, in a table over the distance.
pub(crate) struct StopImage {
    shape: Aperture,
    step_px: f64,
    /// Distance beyond which there is no light, px.
    reach_px: f64,
    tables: Vec<Vec<f64>>,
}

impl StopImage {
    pub fn new(shape: Aperture, half_px: f64, sigma_px: f64, powers: &[i32]) -> Self {
        let step_px = sigma_px / PER_SIGMA;
        let pixel = if shape == Aperture::Square { 0.5 } else { 0.0 };
        let reach_px = half_px + REACH * sigma_px + pixel;
        let count = (reach_px / step_px) as usize + 2;
        let table = |power: i32| {
            let light = |n: usize| blurred(shape, half_px, sigma_px, power, n as f64 * step_px);
            let table: Vec<f64> = (0..count).map(light).collect();
            if shape == Aperture::Square { over_pixels(&table, step_px) } else { table }
        };
        Self { shape, step_px, reach_px, tables: powers.iter().map(|power| table(*power)).collect() }
    }

    /// Distance from the rim that the blur reaches, px.
    pub fn blur_px(&self) -> f64 {
        REACH * PER_SIGMA * self.step_px
    }

    /// Adds the light of each power at an offset from the centre of one image.
    #[inline]
    pub fn add(&self, offset_px: DVec2, light: &mut [f64]) {
        match self.shape {
            Aperture::Circle => {
                let distance = offset_px.length();
                if distance < self.reach_px {
                    light.iter_mut().zip(&self.tables).for_each(|(light, table)| *light += self.at(table, distance));
                }
            }
            Aperture::Square => {
                let [x, y] = offset_px.abs().to_array();
                if x.max(y) >= self.reach_px {
                    return;
                }
                let (even_x, even_y) = (self.at(&self.tables[0], x), self.at(&self.tables[0], y));
                light[0] += even_x * even_y;
                for (light, table) in light[1..].iter_mut().zip(&self.tables[1..]) {
                    *light += self.at(table, x) * even_y + even_x * self.at(table, y);
                }
            }
        }
    }

    #[inline]
    fn at(&self, table: &[f64], distance_px: f64) -> f64 {
        let t = distance_px / self.step_px;
        let n = t as usize;
        table[n] + (t - n as f64) * (table[n + 1] - table[n])
    }
}

/// A table of an even function, averaged over the pixel about each of its places.
fn over_pixels(table: &[f64], step_px: f64) -> Vec<f64> {
    // Integral from 0 to each place, by the trapezoidal rule that suits linear interpolation.
    let mut sums = vec![0.0];
    sums.extend(table.windows(2).scan(0.0, |sum, pair| {
        *sum += 0.5 * step_px * (pair[0] + pair[1]);
        Some(*sum)
    }));
    let integral = |place: f64| {
        let t = (place.abs() / step_px).min((table.len() - 1) as f64);
        let n = (t as usize).min(table.len() - 2);
        let rest = t - n as f64;
        let there = table[n] + rest * (table[n + 1] - table[n]);
        (sums[n] + 0.5 * step_px * rest * (table[n] + there)).copysign(place)
    };
    (0..table.len()).map(|n| integral(n as f64 * step_px + 0.5) - integral(n as f64 * step_px - 0.5)).collect()
}

/// Light at a distance from the middle of (q / half)^power for q within `half`, blurred: over the disc, or over a line.
fn blurred(shape: Aperture, half: f64, sigma: f64, power: i32, distance: f64) -> f64 {
    let least = if shape == Aperture::Circle { 0.0 } else { -half };
    let low = (distance - REACH * sigma).max(least);
    let length = (distance + REACH * sigma).min(half) - low;
    if length <= 0.0 {
        return 0.0;
    }
    let variance = sigma * sigma;
    let light = |n: usize| {
        let q = low + length * n as f64 / INTERVALS as f64;
        let gauss = (-0.5 * (distance - q).powi(2) / variance).exp();
        let weight = match shape {
            Aperture::Circle => q / variance * bessel_i0_scaled(distance * q / variance),
            Aperture::Square => 1.0 / (sigma * std::f64::consts::TAU.sqrt()),
        };
        let simpson = if n == 0 || n == INTERVALS { 1.0 } else { 2.0 + 2.0 * (n % 2) as f64 };
        simpson * weight * gauss * (q / half).powi(power)
    };
    (0..=INTERVALS).map(light).sum::<f64>() * length / (3 * INTERVALS) as f64
}

/// exp(-x) I_0(x) for x >= 0, the modified Bessel function, by Abramowitz and Stegun 9.8.1 and 9.8.2; exact to 2e-7.
fn bessel_i0_scaled(x: f64) -> f64 {
    let horner = |t: f64, factors: &[f64]| factors.iter().rev().fold(0.0, |sum, factor| sum * t + factor);
    if x < 3.75 {
        let factors = [1.0, 3.515_622_9, 3.089_942_4, 1.206_749_2, 0.265_973_2, 0.036_076_8, 0.004_581_3];
        return (-x).exp() * horner((x / 3.75).powi(2), &factors);
    }
    let factors = [
        0.398_942_28,
        0.013_285_92,
        0.002_253_19,
        -0.001_575_65,
        0.009_162_81,
        -0.020_577_06,
        0.026_355_37,
        -0.016_476_33,
        0.003_923_77,
    ];
    horner(3.75 / x, &factors) / x.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The light of a [`StopImage`] by summing the Gaussian over a fine grid of points of the shape.
    fn by_points(shape: Aperture, half: f64, sigma: f64, power: i32, at: DVec2) -> f64 {
        if shape == Aperture::Square {
            let pixel = (0..100).map(|n| (DVec2::new((n % 10) as f64, (n / 10) as f64) + 0.5) / 10.0 - 0.5);
            return pixel.map(|offset| at_point(shape, half, sigma, power, at + offset)).sum::<f64>() / 100.0;
        }
        at_point(shape, half, sigma, power, at)
    }

    fn at_point(shape: Aperture, half: f64, sigma: f64, power: i32, at: DVec2) -> f64 {
        let step = 0.05;
        let n = (half / step) as i64 + 1;
        let mut sum = 0.0;
        for a in -n..n {
            for b in -n..n {
                let q = (DVec2::new(a as f64, b as f64) + 0.5) * step;
                let light = match shape {
                    Aperture::Circle if q.length() < half => (q.length() / half).powi(power),
                    Aperture::Square if q.abs().max_element() < half && power == 0 => 1.0,
                    Aperture::Square if q.abs().max_element() < half => {
                        (q.x.abs() / half).powi(power) + (q.y.abs() / half).powi(power)
                    }
                    _ => 0.0,
                };
                sum += light * (-0.5 * q.distance_squared(at) / (sigma * sigma)).exp();
            }
        }
        sum * step * step / (std::f64::consts::TAU * sigma * sigma)
    }

    #[test]
    fn the_table_is_the_sum_over_points() {
        for shape in [Aperture::Circle, Aperture::Square] {
            for (half, sigma) in [(1.5, 0.4), (4.0, 0.9)] {
                let image = StopImage::new(shape, half, sigma, &[0, 2, 8]);
                for at in [DVec2::ZERO, DVec2::new(0.4, 0.2), DVec2::new(half, 0.3), DVec2::new(0.7, half + 0.8)] {
                    let mut light = [0.0; 3];
                    image.add(at, &mut light);
                    for (light, power) in light.iter().zip([0, 2, 8]) {
                        let wanted = by_points(shape, half, sigma, power, at);
                        assert!((light - wanted).abs() < 0.006, "{shape:?} {half} {at} {power}: {light} {wanted}");
                    }
                }
                let mut dark = [0.0; 3];
                image.add(DVec2::new(half + 6.0 * sigma + 1.0, 0.0), &mut dark);
                assert_eq!(dark, [0.0; 3]);
            }
        }
    }
}
