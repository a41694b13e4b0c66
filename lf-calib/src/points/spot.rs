//! One small spot of light, read from the pixels: its position, its light and its uncertainty. A centroid has to choose
//! between light cut off by a narrow window and noise let in by a wide one. A fit of the profile does neither.

use super::spot_profile::SpotProfile;
use crate::fit::placement::{PlaceSums, StepLimits, fit_place};
use glam::DVec2;
use ndarray::{ArrayView2, s};
use std::ops::Range;

/// Gauss-Newton iterations at most. Each squares the error, which starts at some tenths of the width.
const STEPS: usize = 12;
/// A smaller step ends the fit, px.
const SMALL_STEP_PX: f64 = 1e-4;
/// Radius of the window of the first search: in standard deviations of the whole spot, and at least in px.
const LOOK_SIGMA: f64 = 2.0;
const LOOK_PX: f64 = 2.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SpotFit {
    pub place_px: DVec2,
    /// Standard uncertainty of each coordinate, px, if all pixels are equally noisy.
    pub uncertainty_px: f64,
    /// Standard uncertainty of each coordinate, px, where bright pixels may be noisier. It uses each pixel's residual
    /// by itself, so one spot gives it less precisely than `uncertainty_px`.
    pub by_pixel_px: f64,
    pub light: f64,
    pub explained: f64,
}

/// Columns or rows whose middles lie within `reach` of `centre`. None if one of them is outside the image.
fn within(centre: f64, reach: f64, size: usize) -> Option<Range<usize>> {
    let (first, last) = ((centre - reach - 0.5).ceil(), (centre + reach - 0.5).floor());
    (first >= 0.0 && last < size as f64 && last >= first).then(|| first as usize..last as usize + 1)
}

/// Searches for a spot: the mean position of the light above the window's darkest pixel, with a window that follows it.
/// None if the window leaves the image or the position moves farther than `farthest_px`.
pub(crate) fn find(image: ArrayView2<f32>, profile: SpotProfile, from_px: DVec2, farthest_px: f64) -> Option<DVec2> {
    let reach = (LOOK_SIGMA * profile.deviation_px()).max(LOOK_PX);
    let mut centre = from_px;
    for _ in 0..STEPS {
        let (rows, columns) = (within(centre.y, reach, image.nrows())?, within(centre.x, reach, image.ncols())?);
        let pixels = image.slice(s![rows.clone(), columns.clone()]);
        let floor = pixels.iter().fold(f64::INFINITY, |floor, count| floor.min(f64::from(*count)));
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

/// Fits floor + light x profile to the pixels around a position, by least squares. Pixels that are not finite are left
/// out. None if the window leaves the image, if the position moves farther than `farthest_px`, or if there is no light.
pub(crate) fn fit(image: ArrayView2<f32>, profile: SpotProfile, from_px: DVec2, farthest_px: f64) -> Option<SpotFit> {
    let profile = profile.usable();
    let reach = profile.reach_px();
    let (rows, columns) = (within(from_px.y, reach, image.nrows())?, within(from_px.x, reach, image.ncols())?);
    let longest_px = 0.5 * profile.deviation_px();
    let limits = StepLimits { steps: STEPS, longest_px, small_px: SMALL_STEP_PX, farthest_px };
    let found = fit_place(from_px, &limits, |place| {
        let mut sums = PlaceSums::default();
        each_pixel(image, profile, place, [&rows, &columns], |value, slope, pixel| sums.add(value, slope, pixel));
        sums
    })?;
    let mut variance_px2 = 0.0;
    each_pixel(image, profile, found.place_px, [&rows, &columns], |value, slope, pixel| {
        variance_px2 += found.own_variance_px2(value, slope, pixel);
    });
    Some(SpotFit {
        place_px: found.place_px,
        uncertainty_px: found.spread_px * found.scatter,
        by_pixel_px: variance_px2.sqrt(),
        light: found.gain,
        explained: found.explained,
    })
}

/// Calls `take(value, slope, count)` for each pixel of some rows and columns. Value and slope are those of a spot at
/// `place`. Leaves out pixels that are not finite.
fn each_pixel(
    image: ArrayView2<f32>,
    profile: SpotProfile,
    place: DVec2,
    [rows, columns]: [&Range<usize>; 2],
    mut take: impl FnMut(f64, DVec2, f64),
) {
    let along: Vec<(f64, f64)> = columns.clone().map(|column| profile.share(column as f64 + 0.5 - place.x)).collect();
    for row in rows.clone() {
        let (across, across_slope) = profile.share(row as f64 + 0.5 - place.y);
        for (column, (value, slope)) in columns.clone().zip(&along) {
            let pixel = f64::from(image[(row, column)]);
            if pixel.is_finite() {
                take(value * across, DVec2::new(slope * across, value * across_slope), pixel);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::normal;
    use ndarray::Array2;

    /// The image of a square of `width` convolved with a disc of `radius`, by a fine sum over the disc.
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

    // A centroid of such spots is wrong by up to a tenth of a pixel, depending on the position between the pixels.
    #[test]
    fn positions_are_unbiased_at_any_place_between_pixels() {
        for (width, radius) in [(1.07, 0.35), (1.6, 0.5), (3.3, 1.1), (2.0, 0.1)] {
            let shape = SpotProfile { width_px: width, disc_px: 0.5 * radius, sigma_px: 0.0 };
            let mut worst = 0.0f64;
            for n in 0..49 {
                let place = DVec2::new(8.0 + (n % 7) as f64 / 7.0, 8.0 + (n / 7) as f64 / 7.0);
                let image = spot(place, width, radius, 1000.0);
                let from = find(image.view(), shape, place + DVec2::new(1.2, -0.7), 3.0).unwrap();
                assert!(from.distance(place) < 0.5, "{from} for {place}");
                let found = fit(image.view(), shape, from, 2.0).unwrap();
                worst = worst.max((found.place_px - place).abs().max_element());
                assert!((found.light / 1000.0 - 1.0).abs() < 0.06, "{}", found.light);
            }
            assert!(worst < 0.01, "{width} {radius}: {worst}");
        }
    }

    #[test]
    fn the_stated_uncertainty_is_the_effect_of_noise() {
        let shape = SpotProfile { width_px: 1.5, disc_px: 0.3, sigma_px: 0.0 };
        const SPOTS: usize = 400;
        // All pixels equally noisy; and photons that count 3 each.
        for (read, gain, alike) in [(12.0, 0.0, true), (1.0, 3.0, false)] {
            let (mut square, mut stated, mut by_pixel) = (0.0, 0.0, 0.0);
            let mut state = 5u64;
            for n in 0..SPOTS {
                let place = DVec2::new(8.0 + (n % 20) as f64 / 20.0, 8.0 + (n / 20) as f64 / 20.0);
                let mut noisy = |v: f32| {
                    let sigma = f64::hypot(read, (gain * f64::from(v)).sqrt());
                    v + (sigma * normal(&mut state)) as f32 + 40.0
                };
                let image = spot(place, 1.5, 0.6, 1000.0).mapv(&mut noisy);
                let found = fit(image.view(), shape, place, 2.0).unwrap();
                square += found.place_px.distance_squared(place) / 2.0;
                stated += found.uncertainty_px.powi(2);
                by_pixel += found.by_pixel_px.powi(2);
            }
            let [ratio, of_pixels] = [stated, by_pixel].map(|stated: f64| (square / stated).sqrt());
            println!("noise alike: {alike}: error over uncertainty {ratio:.3}, by pixel {of_pixels:.3}");
            assert!((0.85..1.2).contains(&of_pixels), "{of_pixels}");
            assert_eq!((0.85..1.15).contains(&ratio), alike, "{ratio}");
        }
    }

    #[test]
    fn a_spot_without_light_or_outside_the_image_is_not_fitted() {
        let shape = SpotProfile { width_px: 1.5, disc_px: 0.3, sigma_px: 0.0 };
        let dark = Array2::<f32>::zeros((17, 17));
        assert!(fit(dark.view(), shape, DVec2::splat(8.5), 2.0).is_none());
        let image = spot(DVec2::splat(8.5), 1.5, 0.6, 1000.0);
        assert!(fit(image.view(), shape, DVec2::new(1.0, 8.0), 2.0).is_none());
        assert!(find(image.view(), shape, DVec2::new(1.0, 8.0), 2.0).is_none());
    }
}
