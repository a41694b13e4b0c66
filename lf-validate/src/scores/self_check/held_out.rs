//! Whether a fit predicts pixels that it did not see.

use lf_core::Refusal;
use lf_core::camera::SensorNoise;
use ndarray::{Array2, Zip};
use serde::Serialize;

/// A pixel is lit if its expected light is above this many times the noise of a dark one.
const LIT: f64 = 3.0;
/// Squares are cut here, so that single hot pixels do not decide.
const MOST_SQUARE: f64 = 25.0;
/// Lit pixels that a statement needs.
const FEWEST: usize = 100;

/// The pixels that were held out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HeldOut {
    /// Pixels where light is expected, and others.
    pub lit: usize,
    /// The other pixels.
    pub dark: usize,
    /// Mean squared difference over the variance by noise of the lit pixels.
    pub chi2: f64,
    /// Mean squared difference over the variance of the dark pixels.
    pub chi2_dark: f64,
}

/// Compares the held-out pixels of an image, NaN elsewhere, with what a fit expects. Refuses too few lit ones.
pub fn held_out(image: &Array2<f32>, expected: &Array2<f32>, noise: &SensorNoise) -> Result<HeldOut, Refusal> {
    let SensorNoise { gain_counts, read_noise_counts } = *noise;
    let least = LIT * gain_counts.max(read_noise_counts);
    // Number and sum of squares of dark pixels, then of lit ones.
    let mut sums = [(0usize, 0.0f64); 2];
    Zip::from(image).and(expected).for_each(|seen, light| {
        if !seen.is_nan() {
            let light = f64::from(*light);
            let variance = gain_counts * light.max(0.0) + read_noise_counts.powi(2);
            let (count, sum) = &mut sums[usize::from(light > least)];
            *count += 1;
            *sum += ((f64::from(*seen) - light).powi(2) / variance).min(MOST_SQUARE);
        }
    });
    let [(dark, of_dark), (lit, of_lit)] = sums;
    Refusal::unless(
        lit >= FEWEST,
        || format!("{lit} held-out pixels with light"),
        format!("wanted {FEWEST} or more: hold out a larger share, or give the camera that has these pixels alone"),
    )?;
    Ok(HeldOut { lit, dark, chi2: of_lit / lit as f64, chi2_dark: of_dark / dark as f64 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_by_hand() {
        let noise = SensorNoise { gain_counts: 0.5, read_noise_counts: 2.0 };
        // Lit pixels of 24 counts have a variance of 16, dark ones of 4; blind ones do not count.
        let expected = Array2::from_shape_fn((20, 20), |(row, _)| if row < 10 { 24.0 } else { 0.0 });
        let image = Array2::from_shape_fn((20, 20), |(row, column)| match (row, column) {
            (_, 0) => f32::NAN,
            (0..10, _) => 32.0,
            _ => 2.0,
        });
        let found = held_out(&image, &expected, &noise).unwrap();
        assert_eq!(found, HeldOut { lit: 190, dark: 190, chi2: 4.0, chi2_dark: 1.0 });
        let refused = held_out(&image, &Array2::zeros((20, 20)), &noise).unwrap_err();
        assert_eq!(refused.found, "0 held-out pixels with light");
    }
}
