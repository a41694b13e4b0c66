//! A black level that is clipped: the dark pixels of a camera without an offset are half a normal distribution.

use crate::statistics::Ordered;
use ndarray::{Array2, ArrayView2, s};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Neighbours of a pixel lie in a square that reaches this number of pixels to each side.
const REACH: usize = 2;
/// Looks at every third pixel and row, or at fewer for at most this number of pixels.
const STEP: usize = 3;
const MOST: usize = 400_000;
/// Share of the pixels, those with the darkest neighbours, that are taken as dark.
const DARK: f64 = 0.1;
/// Fewer dark pixels than this show no distribution.
const FEWEST: usize = 200;
/// Shares of the dark pixels at the lowest count that are a clipped normal distribution. Below the first one, clipping
/// moves their mean by less than 0.05 of their noise; above the second one, too little of the noise is left.
const CLIPPED: [f64; 2] = [0.1, 0.9];
/// The mean square of a normal distribution, from its share and its mean above the lowest count, is found to this
/// factor. Light without noise has few bright pixels among many dark ones, and a larger square.
const NORMAL: [f64; 2] = [0.75, 1.35];

/// A clipped black level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClippedBlack {
    /// The lowest count.
    pub level: f32,
    /// Share of the dark pixels that have it.
    pub share: f64,
    /// Standard deviation of a dark pixel before clipping, counts.
    pub noise: f64,
    /// Mean of a dark pixel before clipping, counts.
    pub black: f64,
    /// Mean, before clipping, of the dark pixels that have the lowest count.
    pub cut: f64,
}

impl ClippedBlack {
    /// The clipped black level of an image; None if it is not clipped.
    ///
    /// Dark pixels are those whose neighbours are darkest. Noise is independent of the neighbours, so the choice does
    /// not change its distribution. Share `p` of it is below the edge `a` of the lowest count, and its mean excess over
    /// the edge is `e = sigma (phi(t) - t (1 - p))` with `t = (a - black) / sigma` and `p = Phi(t)`.
    pub fn of(image: ArrayView2<f32>) -> Option<Self> {
        let mut dark = dark_pixels(image);
        let lowest = image.iter().copied().filter(|value| value.is_finite()).min_by(f32::order)?;
        let next = dark.iter().copied().filter(|value| *value > lowest).min_by(f32::order)?;
        let (level, count) = (f64::from(lowest), dark.len() as f64);
        let edge = 0.5 * (level + f64::from(next));
        dark.retain(|value| *value > lowest);
        let share = 1.0 - dark.len() as f64 / count;
        if count < FEWEST as f64 || !(CLIPPED[0]..CLIPPED[1]).contains(&share) {
            return None;
        }
        let mean = |power: i32| dark.iter().map(|value| (f64::from(*value) - edge).powi(power)).sum::<f64>() / count;
        let t = normal_quantile(share);
        let density = (-0.5 * t * t).exp() / TAU.sqrt();
        let noise = mean(1) / (density - t * (1.0 - share));
        let square = noise * noise * ((1.0 + t * t) * (1.0 - share) - t * density);
        let black = edge - t * noise;
        // Noise below a count is lost in rounding.
        let is_normal = (NORMAL[0]..NORMAL[1]).contains(&(mean(2) / square)) && noise >= f64::from(next) - level;
        is_normal.then(|| Self { level: lowest, share, noise, black, cut: black - noise * density / share })
    }

    /// Replaces each pixel by what it would be without clipping, on average over dark pixels. A black level below the
    /// lowest count is raised to it, because no background shows it.
    ///
    /// The mean of many such pixels follows any light to 0.05 of the noise; to 0.2 of it where the black level lies
    /// below the lowest count.
    pub fn unclip(&self, image: &mut Array2<f32>) {
        let below = (self.black as f32 - self.level).min(0.0);
        image.mapv_inplace(|pixel| if pixel <= self.level { self.cut as f32 } else { pixel } - below);
    }
}

/// The pixels whose neighbours are darkest.
fn dark_pixels(image: ArrayView2<f32>) -> Vec<f32> {
    let (height, width) = image.dim();
    let step = STEP.max((image.len() as f64 / MOST as f64).sqrt() as usize);
    let of_row = |row: usize| {
        (REACH..width.saturating_sub(REACH)).step_by(step).map(move |column| {
            let around = s![row - REACH..=row + REACH, column - REACH..=column + REACH];
            (image.slice(around).iter().sum::<f32>() - image[(row, column)], image[(row, column)])
        })
    };
    let rows: Vec<usize> = (REACH..height.saturating_sub(REACH)).step_by(step).collect();
    let mut pixels: Vec<(f32, f32)> = rows.into_par_iter().flat_map_iter(of_row).collect();
    pixels.retain(|(around, pixel)| around.is_finite() && pixel.is_finite());
    let dark = (pixels.len() as f64 * DARK) as usize;
    if dark < pixels.len() {
        pixels.select_nth_unstable_by(dark, |a, b| a.0.total_cmp(&b.0));
    }
    pixels.truncate(dark);
    pixels.into_iter().map(|(_, pixel)| pixel).collect()
}

/// The place below which a normal distribution has this share, in standard deviations, to 4.5e-4 (Abramowitz & Stegun
/// 1964, 26.2.23).
fn normal_quantile(share: f64) -> f64 {
    let s = (-2.0 * share.min(1.0 - share).ln()).sqrt();
    let t = s - (2.515517 + s * (0.802853 + s * 0.010328)) / (1.0 + s * (1.432788 + s * (0.189269 + s * 0.001308)));
    if share < 0.5 { -t } else { t }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::clipped::tests::uniform;

    /// Noise about a black level, with light on some 5 x 5 squares, before rounding and clipping.
    fn frame(noise: f64, black: f64, lit: f64, seed: u64) -> Array2<f32> {
        let mut random = seed;
        let light = Array2::from_shape_fn((120, 120), |_| {
            if uniform(&mut random) < lit { -50.0 * uniform(&mut random).max(1e-9).ln() } else { 0.0 }
        });
        Array2::from_shape_fn((600, 600), |(row, column)| {
            let normal: f64 = (0..12).map(|_| uniform(&mut random)).sum::<f64>() - 6.0;
            (black + noise * normal + light[(row / 5, column / 5)]) as f32
        })
    }

    fn counts(image: &Array2<f32>) -> Array2<f32> {
        image.mapv(|value| value.round().clamp(0.0, 4095.0))
    }

    fn of(image: &Array2<f32>) -> Option<ClippedBlack> {
        ClippedBlack::of(image.view())
    }

    #[test]
    fn a_clipped_black_level_comes_back_with_its_noise() {
        for seed in 0..3 {
            for (noise, black) in [(1.5, 0.0), (4.0, 0.0), (12.0, 0.0), (4.0, 3.0), (4.0, -3.0)] {
                for lit in [0.05, 0.4] {
                    let image = frame(noise, black, lit, seed);
                    for (scale, offset, image) in [
                        (1.0, 0.0, counts(&image)),
                        (16.0, 256.0, counts(&image)),
                        (1.0, 0.0, image.mapv(|v| v.max(0.0))),
                    ] {
                        let found = of(&image.mapv(|value| scale * value + offset)).unwrap();
                        let [noise_off, black_off] = [
                            (found.noise / f64::from(scale) - noise) / noise,
                            ((found.black - f64::from(offset)) / f64::from(scale) - black) / noise,
                        ];
                        assert!(
                            noise_off.abs() < 0.12 && black_off.abs() < 0.12,
                            "{noise} {black} {lit} {scale}: {found:?}"
                        );
                    }
                }
            }
        }
    }

    /// An offset, an image without noise, noise below a count, constants and few values.
    #[test]
    fn other_images_are_not_clipped_at_black() {
        let noisy = frame(4.0, 20.0, 0.2, 1);
        assert_eq!(of(&counts(&noisy)), None);
        assert_eq!(of(&noisy), None);
        let sharp = frame(0.0, 0.0, 0.2, 1);
        assert_eq!(of(&sharp), None);
        let smooth = Array2::from_shape_fn((600, 600), |(row, column)| {
            let sum: f32 = (0..25).map(|n| sharp[((row + n / 5) % 600, (column + n % 5) % 600)]).sum();
            (sum / 25.0 - 3.0).max(0.0)
        });
        assert_eq!(of(&smooth), None);
        assert_eq!(of(&counts(&frame(0.4, 0.0, 0.2, 1))), None);
        for image in [Array2::zeros((600, 600)), Array2::from_elem((600, 600), f32::NAN), Array2::zeros((3, 0))] {
            assert_eq!(of(&image), None);
        }
        assert_eq!(of(&Array2::from_shape_fn((20, 20), |(row, column)| ((row * 7 + column * 3) % 5) as f32)), None);
    }

    /// Weak light is read as it was sent; a clipped frame alone adds up to 0.4 of the noise.
    #[test]
    fn the_mean_of_unclipped_pixels_is_that_of_their_light() {
        for black in [0.0, -3.0] {
            let found = of(&counts(&frame(4.0, black, 0.1, 2))).unwrap();
            for light in [0.0, 1.0, 2.0, 4.0, 8.0, 40.0] {
                let mut seen = counts(&frame(4.0, black + light, 0.0, 3));
                found.unclip(&mut seen);
                let mean = seen.iter().map(|pixel| f64::from(*pixel)).sum::<f64>() / 360_000.0;
                let most = if black < 0.0 { 0.2 } else { 0.06 };
                assert!((mean - light).abs() < most * 4.0, "{black} {light}: {mean} of {found:?}");
            }
        }
    }
}
