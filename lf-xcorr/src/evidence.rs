//! How much of a measured field's shape is flow, and how much is noise.
//!
//! A predictor that holds noise hands it to the next repeat, which sharpens it. So a component is smoothed as lightly as its
//! gradients need only where there is evidence of them: where it varies more over a window or two than noise of the size
//! seen at shorter lengths would. Elsewhere three times as widely. A uniform w is then not measured worse for a steep u.
//!
//! Equation: with L the lightly and H the widely smoothed field, `H + s (L - H)`, `s = 1 - D q / E` between 0 and 1, where E
//! and q are the local means of `(L - H)^2` and of `(f - L)^2`, and D is what E would be to q for noise of the windows, times
//! [`DOUBT`]: Wiener's filter, with the noise seen where flow is not.

use crate::smooth::smooth;

/// Constant: how much wider the wide smoothing is.
pub(crate) const WIDE: f64 = 3.0;

/// Constant: local means are of some twenty independent windows; noise exceeds itself by half in one place of a hundred.
const DOUBT: f64 = 1.5;

/// Smooths `field` as above, `smoothing` nodes where there is evidence; gives the share of that smoothing at each node too.
/// `noise_ratio` is E to q of noise.
pub(crate) fn smoothed_by_evidence(
    shape: [usize; 3],
    field: Vec<[f64; 3]>,
    smoothing: [f64; 3],
    noise_ratio: f64,
) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
    let wide = smoothing.map(|width| WIDE * width);
    let of = |mut field: Vec<[f64; 3]>, width: [f64; 3]| {
        smooth(shape, &mut field, width);
        field
    };
    let (light, heavy) = (of(field.clone(), smoothing), of(field.clone(), wide));
    let square = |a: &[[f64; 3]], b: &[[f64; 3]]| -> Vec<[f64; 3]> {
        let squares = a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| (a[c] - b[c]).powi(2)));
        of(squares.collect(), wide)
    };
    let (seen, short) = (square(&light, &heavy), square(&field, &light));
    let share: Vec<[f64; 3]> = seen
        .iter()
        .zip(&short)
        .map(|(seen, short)| {
            std::array::from_fn(|c| {
                // A local mean carried on beyond the ends can fall below zero.
                let (seen, noise) = (seen[c].max(0.0), DOUBT * noise_ratio * short[c].max(0.0));
                if seen > noise { 1.0 - noise / seen } else { 0.0 }
            })
        })
        .collect();
    let mixed = heavy.iter().zip(&light).zip(&share);
    let mixed =
        mixed.map(|((heavy, light), share)| std::array::from_fn(|c| heavy[c] + share[c] * (light[c] - heavy[c])));
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
        // u a wave of ten nodes, v noise, w zero. White noise: the ratio is summed over the filters, one after the other.
        let field: Vec<[f64; 3]> =
            (0..16000).map(|k| [(k as f64 % 40.0 * 0.628).sin(), random.random::<f64>() - 0.5, 0.0]).collect();
        let width = [1.0; 3];
        let mut spike = vec![[0.0; 3]; 16000];
        spike[20 + 40 * (10 + 20 * 10)] = [1.0; 3];
        let mut light = spike.clone();
        smooth(shape, &mut light, width);
        let mut heavy = spike.clone();
        smooth(shape, &mut heavy, width.map(|w| WIDE * w));
        let power = |a: &[[f64; 3]], b: &[[f64; 3]]| a.iter().zip(b).map(|(a, b)| (a[0] - b[0]).powi(2)).sum::<f64>();
        let ratio = power(&light, &heavy) / power(&spike, &light);
        let (found, share) = smoothed_by_evidence(shape, field.clone(), width, ratio);
        let mean = |component: usize| share.iter().map(|share| share[component]).sum::<f64>() / 16000.0;
        assert!(mean(0) > 0.9 && mean(1) < 0.25 && mean(2) == 0.0, "{} {} {}", mean(0), mean(1), mean(2));
        // exp(-0.628^2 / 2) = 0.82 of the wave, and little of the noise.
        let rms = |field: &[[f64; 3]], c: usize| (field.iter().map(|f| f[c] * f[c]).sum::<f64>() / 16000.0).sqrt();
        assert!(rms(&found, 0) > 0.7 * rms(&field, 0) && rms(&found, 1) < 0.12 * rms(&field, 1));
    }

    #[test]
    fn a_linear_field_stays_what_it_is() {
        let shape = [9, 7, 5];
        let linear: Vec<[f64; 3]> = (0..315).map(|k| [(k % 9) as f64, 0.5, (k / 63) as f64 * -2.0]).collect();
        let (found, _) = smoothed_by_evidence(shape, linear.clone(), [1.4; 3], 0.5);
        let near = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-9);
        assert!(found.iter().zip(&linear).all(near));
    }
}
