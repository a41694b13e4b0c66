//! The light of two lasers that take turns.
//!
//! The light of a particle falls on neighbouring pixels together; the noise of a pixel is its own. So the covariance of
//! neighbours over the frames of a laser is proportional to the square of its light, and noise adds nothing to it on
//! average. A mean above the minimum would count the noise: the minimum of N noisy counts lies below their mean.

use ndarray::{Array2, ArrayView2, Zip, s};
use std::ops::Range;

/// Bands of rows that are left out in turn for the uncertainty.
const BANDS: usize = 16;
/// A factor with a larger share of uncertainty may come from noise alone.
const MOST_UNCERTAIN: f64 = 0.3;

/// The light of first and second frames above what stays in all frames of their kind.
#[derive(Debug, Clone, Default)]
pub struct Lasers {
    kinds: [Option<Kind>; 2],
}

/// A factor and its standard uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factor {
    /// Light of laser 0 over that of laser 1.
    pub value: f64,
    /// Standard uncertainty, by the scatter from band to band of the image.
    pub uncertainty: f64,
}

/// Frames of one laser.
#[derive(Debug, Clone)]
struct Kind {
    /// The first frame. It is subtracted from all, so that sums stay exact.
    first: Array2<f32>,
    /// Sum of the frames, each minus the first one and minus its mean, which removes a dark level that drifts.
    sum: Array2<f64>,
    /// For each row, the sum over its pixels and all frames of products with the neighbours on the right and below.
    products: Vec<f64>,
    frames: usize,
}

impl Kind {
    fn new(first: &Array2<f32>) -> Self {
        let (height, _) = first.dim();
        Self { first: first.clone(), sum: Array2::zeros(first.dim()), products: vec![0.0; height], frames: 1 }
    }

    fn add(&mut self, frame: &Array2<f32>) {
        let mut change = Zip::from(frame).and(&self.first).map_collect(|a, b| f64::from(*a) - f64::from(*b));
        change -= change.mean().unwrap_or_default();
        self.sum += &change;
        self.products.iter_mut().zip(with_neighbours(&change)).for_each(|(sum, product)| *sum += product);
        self.frames += 1;
    }

    /// For each row, the sum of the covariances of its pixels with their neighbours. None for one frame.
    fn covariances(&self) -> Option<Vec<f64>> {
        let count = self.frames as f64;
        let of_means = with_neighbours(&self.sum);
        let rows = self.products.iter().zip(of_means).map(|(product, mean)| (product - mean / count) / (count - 1.0));
        (self.frames > 1).then(|| rows.collect())
    }
}

/// For each row, the sum over its pixels of the products with their neighbours on the right and below.
fn with_neighbours(image: &Array2<f64>) -> Vec<f64> {
    let product = |a: ArrayView2<f64>, b: ArrayView2<f64>| (&a * &b).sum();
    let (height, width) = image.dim();
    let row = |n: usize| {
        let this = image.slice(s![n..n + 1, ..]);
        let right = product(this.slice(s![.., ..width - 1]), this.slice(s![.., 1..]));
        let below = (n + 1 < height).then(|| product(this, image.slice(s![n + 1..n + 2, ..])));
        right + below.unwrap_or_default()
    };
    (0..height).map(row).collect()
}

impl Lasers {
    /// Adds a frame of laser 0 or 1. All have one size.
    pub fn add(&mut self, laser: usize, frame: &Array2<f32>) {
        match &mut self.kinds[laser] {
            Some(kind) => kind.add(frame),
            None => self.kinds[laser] = Some(Kind::new(frame)),
        }
    }

    /// The factor that gives the frames of laser 1 the light of those of laser 0. None without two frames of each, or
    /// without light that stands out from the noise.
    pub fn factor(&self) -> Option<Factor> {
        let [first, second] = [self.kinds[0].as_ref()?.covariances()?, self.kinds[1].as_ref()?.covariances()?];
        let rows = first.len().min(second.len());
        let bands = BANDS.min(rows);
        let without = |band: Range<usize>| {
            let light = |rows: &[f64]| rows.iter().sum::<f64>() - rows[band.clone()].iter().sum::<f64>();
            let [a, b] = [light(&first), light(&second)];
            (a > 0.0 && b > 0.0).then(|| 0.5 * (a / b).ln())
        };
        let value = without(0..0)?.exp();
        let others: Option<Vec<f64>> = (0..bands).map(|n| without(n * rows / bands..(n + 1) * rows / bands)).collect();
        let others = others?;
        let count = others.len() as f64;
        let mean = others.iter().sum::<f64>() / count;
        // The jackknife: the logarithms' scatter, times the number of bands less one.
        let variance = others.iter().map(|other| (other - mean).powi(2)).sum::<f64>() * (count - 1.0) / count;
        (variance.sqrt() < MOST_UNCERTAIN).then(|| Factor { value, uncertainty: value * variance.sqrt() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{normal, uniform};

    const SIDE: usize = 96;

    /// Frames of two lasers with the same particles, each 3 px wide, over backgrounds of 10 and 4 counts.
    fn factor(frames: [usize; 2], light: [f64; 2], noise: f64, seed: u64) -> Option<Factor> {
        let mut lasers = Lasers::default();
        for n in 0..frames[0].max(frames[1]) {
            let mut state = 1000 * seed + n as u64 + 1;
            let mut particles = Array2::<f64>::zeros((SIDE, SIDE));
            for _ in 0..150 {
                let place = [0, 1].map(|_| (uniform(&mut state) * (SIDE - 3) as f64) as usize);
                particles
                    .slice_mut(s![place[0]..place[0] + 3, place[1]..place[1] + 3])
                    .mapv_inplace(|count| count + 1.0);
            }
            for laser in (0..2).filter(|laser| n < frames[*laser]) {
                let dark = [10.0, 4.0][laser];
                let frame = particles.mapv(|count| (dark + light[laser] * count + noise * normal(&mut state)) as f32);
                lasers.add(laser, &frame);
            }
        }
        lasers.factor()
    }

    #[test]
    fn the_factor_is_that_of_the_light_above_the_background() {
        let found = factor([3, 3], [100.0, 75.0], 0.0, 1).unwrap();
        assert!((found.value - 4.0 / 3.0).abs() < 1e-5 && found.uncertainty < 1e-5, "{found:?}");
        assert_eq!(factor([1, 3], [100.0, 75.0], 0.0, 1), None);
    }

    /// The factors of several seeds scatter about the truth by their uncertainty, whatever the noise and the counts.
    #[test]
    fn noise_and_unequal_counts_do_not_move_the_factor() {
        for (frames, light, noise) in [([5, 5], [4.0, 2.0], 3.0), ([5, 5], [8.0, 8.0], 3.0), ([60, 2], [6.0, 6.0], 1.0)]
        {
            let errors: Vec<f64> = (0..12)
                .map(|seed| {
                    let found = factor(frames, light, noise, seed).unwrap();
                    (found.value - light[0] / light[1]) / found.uncertainty
                })
                .collect();
            let mean = errors.iter().sum::<f64>() / errors.len() as f64;
            let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
            assert!(mean.abs() < 1.0 && (0.3..2.0).contains(&rms), "{frames:?} {light:?}: {errors:.2?}");
        }
    }

    #[test]
    fn frames_without_light_have_no_factor() {
        assert!((0..20).all(|seed| factor([4, 4], [0.0, 0.0], 3.0, seed).is_none()));
    }
}
