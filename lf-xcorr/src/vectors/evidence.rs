//! How much of a measured field's shape is flow, and how much is noise.
//!
//! A predictor passes its noise to the next repeat, which sharpens it. A component is therefore smoothed narrowly only
//! where it varies more over one or two windows than noise would, by the noise seen at shorter lengths. Elsewhere the
//! smoothing is three times as wide. So a steep u does not make the measurement of a uniform w worse.
//!
//! Equation: with N the narrowly and W the widely smoothed field, the result is `W + s (N - W)`, `s = 1 - D q / E`
//! between 0 and 1. E and q are the local means of `(N - W)^2` and of `(f - N)^2`; D is the ratio E / q for the noise
//! of windows, times [`DOUBT`]. This is Wiener's filter, with the noise measured at lengths at which there is no flow.

use super::smooth::smooth;
use glam::DVec3;

/// Constant: width of the wide smoothing over that of the narrow one.
pub(crate) const WIDE: f64 = 3.0;

/// Constant: a local mean averages about twenty independent windows, so noise exceeds its mean by half in one place of
/// a hundred.
const DOUBT: f64 = 1.5;

/// Smooths `field` by the equation above, with a narrow width of `smoothing` nodes. Returns the field and, for each
/// node and component, the fraction `s` of the narrow smoothing. `noise_ratio` is E / q of noise.
pub(crate) fn smoothed_by_evidence(
    shape: [usize; 3],
    field: &[DVec3],
    smoothing: DVec3,
    noise_ratio: f64,
) -> (Vec<DVec3>, Vec<DVec3>) {
    let width = WIDE * smoothing;
    let [narrow, wide] = [smoothing, width].map(|width| smooth(shape, field, width));
    let mean_square = |a: &[DVec3], b: &[DVec3]| {
        let squares: Vec<DVec3> = a.iter().zip(b).map(|(a, b)| (*a - *b) * (*a - *b)).collect();
        smooth(shape, &squares, width)
    };
    let (seen, short) = (mean_square(&narrow, &wide), mean_square(field, &narrow));
    let share_of = |(seen, short): (&DVec3, &DVec3)| {
        DVec3::from_array([0, 1, 2].map(|c| {
            // A local mean extrapolated beyond the ends can fall below zero.
            let (seen, noise) = (seen[c].max(0.0), DOUBT * noise_ratio * short[c].max(0.0));
            if seen > noise { 1.0 - noise / seen } else { 0.0 }
        }))
    };
    let share: Vec<DVec3> = seen.iter().zip(&short).map(share_of).collect();
    let mixed = wide.iter().zip(&narrow).zip(&share).map(|((wide, narrow), share)| *wide + *share * (*narrow - *wide));
    (mixed.collect(), share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn a_wave_is_kept_and_noise_is_not() {
        let shape = [40, 20, 20];
        let mut random = Pcg64Mcg::seed_from_u64(1);
        // u is a wave of ten nodes, v is white noise, w is zero. The noise ratio follows from the response to a spike.
        let mut vector = |k: usize| DVec3::new((k as f64 % 40.0 * 0.628).sin(), random.random::<f64>() - 0.5, 0.0);
        let field: Vec<DVec3> = (0..16000).map(&mut vector).collect();
        let width = DVec3::ONE;
        let mut spike = vec![DVec3::ZERO; 16000];
        spike[20 + 40 * (10 + 20 * 10)] = DVec3::ONE;
        let [narrow, wide] = [width, WIDE * width].map(|width| smooth(shape, &spike, width));
        let power = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| (a[0] - b[0]).powi(2)).sum::<f64>();
        let ratio = power(&narrow, &wide) / power(&spike, &narrow);
        let (found, share) = smoothed_by_evidence(shape, &field, width, ratio);
        let mean = |component: usize| share.iter().map(|share| share[component]).sum::<f64>() / 16000.0;
        assert!(mean(0) > 0.9 && mean(1) < 0.25 && mean(2) == 0.0, "{} {} {}", mean(0), mean(1), mean(2));
        // exp(-0.628^2 / 2) = 0.82 of the wave is left, and little of the noise.
        let rms = |field: &[DVec3], c: usize| (field.iter().map(|f| f[c] * f[c]).sum::<f64>() / 16000.0).sqrt();
        assert!(rms(&found, 0) > 0.7 * rms(&field, 0) && rms(&found, 1) < 0.12 * rms(&field, 1));
    }

    #[test]
    fn a_linear_field_is_unchanged() {
        let shape = [9, 7, 5];
        let linear: Vec<DVec3> = (0..315).map(|k| DVec3::new((k % 9) as f64, 0.5, (k / 63) as f64 * -2.0)).collect();
        let (found, _) = smoothed_by_evidence(shape, &linear, DVec3::splat(1.4), 0.5);
        let near = |(a, b): (&DVec3, &DVec3)| (*a - *b).abs().max_element() < 1e-9;
        assert!(found.iter().zip(&linear).all(near));
    }
}
