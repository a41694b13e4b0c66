//! Gain and read noise of a sensor by photon transfer (Janesick 2007): the variance of a pixel against its mean, from
//! pairs of white images of the same light and from dark images.
//!
//! The difference of two images holds no pattern, only noise. White images of lenslets have every level from dark to
//! bright. Pixels are put into bins of equal numbers by their mean; the variance of a bin is the mean of the squared
//! differences without outliers. The read noise is that of the dark images.

use lf_core::camera::SensorNoise;
use lf_core::{Refusal, statistics::upper_median};
use ndarray::Array2;

/// Gain and read noise with their standard uncertainties, counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotonTransfer {
    /// Gain and read noise.
    pub noise: SensorNoise,
    /// Standard uncertainties of the same.
    pub uncertainty: SensorNoise,
    /// Largest departure of a bin's variance from the line, over the variance: the sensor is not linear, or the light
    /// changed between the images.
    pub departure: f64,
}

/// Bins of equal numbers of pixels.
const BINS: usize = 24;
/// Smallest number of pixels of a pair.
const FEWEST: usize = 10_000;
/// Median of the square of a normal variable over its variance.
const MEDIAN_OF_SQUARE: f64 = 0.454_936;
/// Limit of a deviation that is averaged, standard deviations, and the variance of a normal variable within it.
const LIMIT: f64 = 4.0;
const WITHIN: f64 = 0.998_929;
/// A pixel whose dark level is off the usual one by more than this number of standard deviations is hot.
const HOT: f64 = 10.0;
/// Rounds of the weighted fit of the line.
const ROUNDS: usize = 4;
/// Brightest levels that are left out, as a share of the largest count: clipped pixels have no noise. The mean of a
/// pair decides: their larger count would keep the pairs that differ little.
const BELOW_CLIPPED: f32 = 0.97;
/// Variance of a sensor that rounds to whole counts, and the least read noise that whole counts show.
const ROUNDING: f64 = 1.0 / 12.0;

/// Finds the noise of a sensor. The white images show the same light, up to a factor; one dark image is enough.
pub fn photon_transfer(whites: &[Array2<f32>], darks: &[Array2<f32>]) -> Result<PhotonTransfer, Refusal> {
    let wanted = "wanted two or more white images of the same light, and a dark one";
    Refusal::unless(whites.len() >= 2, || format!("{} white images", whites.len()), wanted)?;
    Refusal::unless(!darks.is_empty(), || "no dark image", wanted)?;
    let (read_variance, read_error) = dark_variance(darks)?;
    let mut dark = mean(darks);
    let usual = upper_median(&mut dark.iter().copied().collect::<Vec<f32>>()).unwrap_or(0.0);
    let most = (HOT * read_variance.sqrt()) as f32;
    dark.mapv_inplace(|level| if (level - usual).abs() <= most { level } else { f32::NAN });

    let light = |image: &Array2<f32>| -> f64 {
        let counts = image.iter().zip(&dark).map(|(count, dark)| f64::from(count - dark));
        counts.filter(|count| count.is_finite()).sum()
    };
    // The points of a pair. `gain` is a first one.
    let points_of = |pair: &[Array2<f32>], gain: f64| {
        let factor = light(&pair[0]) / light(&pair[1]);
        let is_light = factor.is_finite() && factor > 0.0;
        Refusal::unless(is_light, || "a white image without light", wanted)?;
        bins([&pair[0], &pair[1], &dark], factor, [gain, read_variance])
    };
    let first = fitted(&points_of(&whites[..2], 0.0)?, read_variance)[0].max(0.0);
    let mut points = Vec::new();
    for pair in whites.windows(2) {
        points.extend(points_of(pair, first)?);
    }
    let [gain, variance] = fitted(&points, read_variance);
    let found = || format!("a variance that changes by {gain:.2e} for each count of light");
    let wanted = "wanted raw counts, neither smoothed nor compressed, of the same light";
    Refusal::unless(gain > 0.0 && gain.is_finite(), found, wanted)?;
    // Pixels without light are in the order of their noise.
    let is_lit = |point: &&Point| gain * point.mean > read_variance;
    let departure = points.iter().filter(is_lit).map(|point| {
        let line = gain * point.mean + read_variance;
        (point.variance / line - 1.0).abs()
    });
    // Images that share a neighbour are not independent.
    let shared = if whites.len() > 2 { 1.5f64.sqrt() } else { 1.0 };
    let read = read_variance.sqrt();
    Ok(PhotonTransfer {
        noise: SensorNoise { gain_counts: gain, read_noise_counts: read },
        uncertainty: SensorNoise { gain_counts: variance.sqrt() * shared, read_noise_counts: 0.5 * read_error / read },
        departure: departure.fold(0.0, f64::max),
    })
}

/// Pixels of about one level.
struct Point {
    /// Light, counts.
    mean: f64,
    variance: f64,
    pixels: f64,
}

/// The gain and its variance: the line through the variance of dark pixels, with points weighted by their own variance.
fn fitted(points: &[Point], read_variance: f64) -> [f64; 2] {
    let slope = |weights: &dyn Fn(&Point) -> f64| {
        let [xy, xx] = points.iter().fold([0.0; 2], |[xy, xx], point| {
            let weight = weights(point);
            [xy + weight * point.mean * (point.variance - read_variance), xx + weight * point.mean * point.mean]
        });
        [xy / xx, 1.0 / xx]
    };
    let spread = |point: &Point, gain: f64| {
        let variance = (gain * point.mean).max(0.0) + read_variance;
        2.0 * variance * variance / point.pixels
    };
    let mut found = slope(&|_| 1.0);
    for _ in 0..ROUNDS {
        let [gain, _] = found;
        found = slope(&|point| 1.0 / spread(point, gain));
    }
    found
}

/// The points of a pair, whose second image has `factor` times less light. Differences are outliers by the variance
/// that `gain` and the read variance mean for their own pixel: a bin at the rims of lenslet images holds all levels.
fn bins([first, second, dark]: [&Array2<f32>; 3], factor: f64, [gain, read]: [f64; 2]) -> Result<Vec<Point>, Refusal> {
    let top = first.iter().chain(second).fold(0f32, |most, count| most.max(*count)) * BELOW_CLIPPED;
    let pairs = first.iter().zip(second).zip(dark);
    let kept =
        pairs.filter(|((a, b), dark)| a.is_finite() && b.is_finite() && dark.is_finite() && 0.5 * (*a + **b) < top);
    let mut pixels: Vec<[f64; 2]> = kept
        .map(|((a, b), dark)| {
            let [a, b] = [a - dark, b - dark].map(f64::from);
            [0.5 * (a + factor * b), a - factor * b]
        })
        .collect();
    let found = || format!("{} pixels below the brightest", pixels.len());
    Refusal::unless(pixels.len() >= FEWEST, found, format!("wanted {FEWEST} or more in white images"))?;
    pixels.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let size = pixels.len().div_ceil(BINS);
    // With light A in a and A / f in b, the variance of a - f b is g A (1 + f) + r^2 (1 + f^2).
    let of_reading = read * (1.0 + factor * factor);
    let expected = |mean: f64| gain * mean.max(0.0) * (1.0 + factor) + of_reading;
    Ok(pixels
        .chunks(size)
        .map(|chunk| {
            let count = chunk.len() as f64;
            let mut squares: Vec<f64> = chunk.iter().map(|[mean, off]| off * off / expected(*mean)).collect();
            let square = spread(&mut squares, 2.0 * ROUNDING / of_reading);
            let square = square * chunk.iter().map(|[mean, _]| expected(*mean)).sum::<f64>() / count;
            let mean = chunk.iter().map(|pixel| pixel[0]).sum::<f64>() / count;
            Point { mean, variance: (square - of_reading) / (1.0 + factor) + read, pixels: count }
        })
        .collect())
}

/// A robust mean of squares of normal variables. Whole counts move a median by up to a step, so it only sets the limit
/// below which squares are averaged.
fn spread(squares: &mut [f64], least: f64) -> f64 {
    let median = upper_median(squares).unwrap_or(0.0) / MEDIAN_OF_SQUARE;
    let limit = LIMIT * LIMIT * median.max(least);
    let [sum, count] = squares
        .iter()
        .filter(|square| **square < limit)
        .fold([0.0; 2], |[sum, count], square| [sum + square, count + 1.0]);
    if count > 0.0 { sum / count / WITHIN } else { 0.0 }
}

fn mean(images: &[Array2<f32>]) -> Array2<f32> {
    let mut sum = images[0].clone();
    images[1..].iter().for_each(|image| sum += image);
    sum / images.len() as f32
}

/// Variance of a pixel without light and its standard uncertainty: from pairs, or in one image from the differences of
/// neighbours, where a pattern counts as noise.
fn dark_variance(darks: &[Array2<f32>]) -> Result<(f64, f64), Refusal> {
    let differences: Vec<f64> = match darks {
        [one] => one
            .rows()
            .into_iter()
            .flat_map(|row| {
                let pairs: Vec<f64> =
                    row.iter().step_by(2).zip(row.iter().skip(1).step_by(2)).map(|(a, b)| f64::from(a - b)).collect();
                pairs
            })
            .collect(),
        several => several
            .chunks_exact(2)
            .flat_map(|pair| pair[0].iter().zip(&pair[1]).map(|(a, b)| f64::from(a - b)))
            .collect(),
    };
    let mut squares: Vec<f64> = differences.iter().filter(|d| d.is_finite()).map(|d| d * d).collect();
    let count = squares.len() as f64;
    let variance = (0.5 * spread(&mut squares, 2.0 * ROUNDING)).max(ROUNDING);
    let wanted = format!("wanted {FEWEST} or more in a dark image");
    Refusal::unless(count >= FEWEST as f64 / 2.0, || format!("{count} pairs of pixels"), wanted)?;
    Ok((variance, variance * (2.0 / count).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{normal, uniform};

    /// Photons as a normal variable, read noise, a level of 20 counts, whole counts, and some dead and hot pixels.
    fn image(side: usize, gain: f64, read: f64, light: f64, seed: u64) -> Array2<f32> {
        let mut state = seed;
        Array2::from_shape_fn((side, side), |(row, column)| {
            let counts = light * (0.5 + 0.5 * (column as f64 / 7.0).sin() * (row as f64 / 9.0).cos());
            let noise = (gain * counts + read * read).sqrt() * normal(&mut state);
            let count = (counts + 20.0 + noise).round().max(0.0);
            if uniform(&mut state) < 0.002 { 4095.0 } else { count as f32 }
        })
    }

    /// Scar: lenslet images are bright plateaus with steep rims. Of a plateau those pairs were kept whose counts are
    /// both below the brightest, and bins at a rim hold all levels, of which the bright ones were taken for outliers:
    /// the gain was 5 % too low, and the sensor 'not linear'.
    #[test]
    fn steep_rims_leave_the_gain_alone() {
        let image = |light: f64, seed: u64| {
            let mut state = seed;
            Array2::from_shape_fn((300, 300), |(_, column)| {
                let counts = light * [0.0, 0.0, 0.0, 0.02, 0.3, 0.9, 0.98, 1.0, 0.98, 0.9, 0.3, 0.02][column % 12];
                ((0.4 * counts + 6.25).sqrt() * normal(&mut state) + counts + 64.0).round() as f32
            })
        };
        let whites = [3, 4, 5, 6].map(|seed| image(3000.0, seed));
        let found = photon_transfer(&whites, &[image(0.0, 7), image(0.0, 8)]).unwrap();
        assert!((found.noise.gain_counts - 0.4).abs() < 0.004 && found.departure < 0.1, "{found:?}");
    }

    #[test]
    fn gain_and_read_noise_come_back() {
        for (gain, read) in [(0.4, 2.0), (2.5, 6.0), (0.1, 0.8)] {
            let whites = [image(300, gain, read, 2000.0, 3), image(300, gain, read, 1900.0, 4)];
            let darks = [image(300, gain, read, 0.0, 5), image(300, gain, read, 0.0, 6)];
            for darks in [&darks[..1], &darks[..]] {
                let PhotonTransfer { noise, uncertainty, departure } = photon_transfer(&whites, darks).unwrap();
                println!("{noise:?} {uncertainty:?} {departure}");
                // Rounding to whole counts is part of the read noise.
                let [of_gain, of_read] =
                    [noise.gain_counts / gain, noise.read_noise_counts / (read * read + ROUNDING).sqrt()];
                assert!((of_gain - 1.0).abs() < 0.02 && (of_read - 1.0).abs() < 0.02, "{noise:?}");
                assert!((noise.gain_counts - gain).abs() < 4.0 * uncertainty.gain_counts, "{noise:?} {uncertainty:?}");
                assert!(departure < 0.1, "{departure}");
            }
        }
    }

    #[test]
    fn what_holds_no_noise_is_refused() {
        let white = image(200, 0.4, 2.0, 2000.0, 3);
        let dark = image(200, 0.4, 2.0, 0.0, 5);
        let refused = photon_transfer(std::slice::from_ref(&white), std::slice::from_ref(&dark)).unwrap_err();
        assert_eq!(refused.found, "1 white images");
        let refused = photon_transfer(&[white.clone(), white], &[dark]).unwrap_err();
        assert!(refused.found.starts_with("a variance that changes by"), "{refused:?}");
    }
}
