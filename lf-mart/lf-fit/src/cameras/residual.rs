//! Whether the differences between image and expected counts look like noise, however large they are.
//!
//! Noise that is found from the differences always explains them. But the noise of a pixel is independent of that of
//! the next, while an error of the model reaches over several pixels.

use super::view::{CameraView, Cameras};
use rayon::prelude::*;

/// Correlation of the differences of lit pixels, each over its standard deviation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Residual {
    /// Between neighbours in a row or column.
    pub beside: f64,
    /// Between neighbours along a diagonal.
    pub diagonal: f64,
}

/// The largest correlation of neighbours that counts as noise. A right model of real optics leaves up to 0.11, an
/// f-number 1 % off 0.2, and 2 % off 0.41.
pub const RANDOM: f64 = 0.15;
/// Beyond this, in lit and dark pixels, the light of particles is missing, or their images are not quite right. Frames
/// of equal particles in the far field left 0.001 to 0.03, five missing faint ones of 54 left 0.06 to 0.18.
const LEFT: f64 = 0.01;

impl Residual {
    /// Whether the differences are more alike than noise.
    pub fn is_model_error(&self) -> bool {
        self.beside > RANDOM
    }

    /// Variance of a mean over several pixels, over that of independent ones; 1 for noise.
    pub(crate) fn excess(&self) -> f64 {
        if self.is_model_error() { 1.0 + 4.0 * (self.beside + self.diagonal).max(0.0) } else { 1.0 }
    }
}

/// Sums of products of differences, and their numbers: of a pixel with itself, beside, and along diagonals.
type Products = [(f64, f64); 3];

fn add(mut sum: Products, more: Products) -> Products {
    sum.iter_mut().zip(more).for_each(|(sum, more)| *sum = (sum.0 + more.0, sum.1 + more.1));
    sum
}

/// The products within the first row, and between the two. Rows hold NaN where no product is wanted.
fn products(row: &[f32], next: &[f32]) -> Products {
    let of = |pairs: &mut dyn Iterator<Item = (&f32, &f32)>| {
        let products = pairs.map(|(one, other)| f64::from(one * other)).filter(|product| !product.is_nan());
        products.fold((0.0, 0.0), |(sum, count), product| (sum + product, count + 1.0))
    };
    let tail = |row: &'_ [f32]| row.len().min(1);
    let (after, next_after) = (&row[tail(row)..], &next[tail(next)..]);
    let beside = [of(&mut row.iter().zip(after)), of(&mut row.iter().zip(next))];
    let diagonal = [of(&mut row.iter().zip(next_after)), of(&mut after.iter().zip(next))];
    let both = |[one, other]: [(f64, f64); 2]| (one.0 + other.0, one.1 + other.1);
    [of(&mut row.iter().zip(row)), both(beside), both(diagonal)]
}

impl CameraView<'_> {
    /// The products of the pixels that are expected to have more than `least` counts.
    fn products(&self, least: f32) -> Products {
        let differences = |row: usize| self.differences(row, least);
        let rows: Vec<Vec<f32>> = (0..self.image.nrows()).into_par_iter().map(differences).collect();
        let nothing = Vec::new();
        let of_row = |row: usize| products(&rows[row], rows.get(row + 1).unwrap_or(&nothing));
        let sums: Vec<Products> = (0..rows.len()).into_par_iter().map(of_row).collect();
        // Added up in order, for the same sum by any number of threads.
        sums.into_iter().fold(Products::default(), add)
    }
}

impl Cameras<'_> {
    /// The correlation of the differences of all images. That of nothing is 0.
    pub(crate) fn residual(&self) -> Residual {
        self.residual_of(|view| view.lit())
    }

    /// Whether the differences of all pixels may hold the light of missing particles. Faint ones lie in dark pixels.
    pub(crate) fn has_light_left(&self) -> bool {
        self.residual_of(|_| f32::NEG_INFINITY).beside > LEFT
    }

    fn residual_of(&self, least: impl Fn(&CameraView) -> f32) -> Residual {
        let sums = self.views.iter().map(|view| view.products(least(view))).fold(Products::default(), add);
        let mean = |n: usize| sums[n].0 / sums[n].1.max(1.0);
        let own = mean(0).max(f64::MIN_POSITIVE);
        Residual { beside: mean(1) / own, diagonal: mean(2) / own }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cameras::view::tests::{Sight, view};
    use lf_core::camera::Pose;
    use rand::RngExt;
    use rand_pcg::Pcg64Mcg;

    /// Light of 400 counts, and an image that differs from it by noise, each value of `side` x `side` pixels.
    fn residual(side: usize) -> Residual {
        let mut random = Pcg64Mcg::new(5);
        let mut sight = Sight::new(20);
        let noise: Vec<f32> = (0..280 * 280).map(|_| random.random::<f32>() - 0.5).collect();
        // Light of particles beside the image does not count.
        let beside = |place: usize| if (40..240).contains(&place) { 0.0 } else { 900.0 };
        sight.fill(|row, column| {
            400.0 + beside(row) + beside(column) + 50.0 * noise[280 * (row / side) + column / side]
        });
        let mut view = view(&sight, Pose::default(), 1.0);
        view.expected.fill(400.0);
        Cameras { views: vec![view] }.residual()
    }

    #[test]
    fn noise_is_independent_and_errors_of_a_model_are_not() {
        let noise = residual(1);
        assert!(noise.beside.abs() < 0.02 && noise.diagonal.abs() < 0.02 && noise.excess() == 1.0, "{noise:?}");
        // Half of the neighbours in a row share a value of 2 x 2 pixels, a quarter of those along a diagonal.
        let error = residual(2);
        assert!((error.beside - 0.5).abs() < 0.02 && (error.diagonal - 0.25).abs() < 0.02, "{error:?}");
        assert!((error.excess() - 4.0).abs() < 0.15);
    }

    #[test]
    fn blind_and_dark_pixels_do_not_count() {
        let nan = f32::NAN;
        assert_eq!(products(&[1.0, 2.0, nan], &[3.0, nan, 4.0]), [(5.0, 2.0), (5.0, 2.0), (8.0 + 6.0, 2.0)]);
        assert_eq!(products(&[], &[]), Products::default());
    }
}
