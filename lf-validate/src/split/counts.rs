//! Thins the electrons of a frame into two frames of independent noise.

use lf_core::camera::SensorNoise;
use ndarray::{Array2, Zip};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Two frames that add up to `light`, counts without a background. Each has half of the light, the same gain, and a
/// read noise that is smaller by the root of 2.
///
/// Each electron goes into one of the two frames by the toss of a coin. Binomial parts of a Poisson variable are
/// independent. Read noise counts as `read_noise^2 / gain^2` more electrons, which have its variance and whose mean is
/// taken off again.
pub fn thinned(light: &Array2<f32>, noise: &SensorNoise, seed: u64) -> [Array2<f32>; 2] {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let gain = noise.gain_counts;
    let added = (noise.read_noise_counts / gain).powi(2);
    let one = light.mapv(|counts| {
        let electrons = f64::from(counts) / gain + added;
        let whole = electrons.round().max(0.0);
        // Both frames share the rest that rounding leaves.
        (gain * (heads(whole as u64, &mut random) + 0.5 * (electrons - whole - added))) as f32
    });
    let other = Zip::from(light).and(&one).map_collect(|all, one| all - one);
    [one, other]
}

/// Heads in this number of tosses of a coin: the bits that are set.
fn heads(mut tosses: u64, random: &mut Pcg64Mcg) -> f64 {
    let mut heads = 0;
    while tosses >= 64 {
        heads += u64::from(random.random::<u64>().count_ones());
        tosses -= 64;
    }
    heads += u64::from((random.random::<u64>() & ((1 << tosses) - 1)).count_ones());
    heads as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::{Distribution, Normal, Poisson};

    /// Mean, variance of one frame, and covariance of both, for pixels of one light.
    fn moments(electrons: f64, noise: &SensorNoise) -> [f64; 3] {
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let (photons, read) = (Poisson::new(electrons).unwrap(), Normal::new(0.0, noise.read_noise_counts).unwrap());
        let light = Array2::from_shape_simple_fn((400, 500), || {
            (noise.gain_counts * photons.sample(&mut random) + read.sample(&mut random)) as f32
        });
        let [a, b] = thinned(&light, noise, 7);
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            a.iter().zip(&b).map(|(a, b)| of(f64::from(*a), f64::from(*b))).sum::<f64>() / a.len() as f64
        };
        let [ma, mb] = [sum(&|a, _| a), sum(&|_, b| b)];
        [ma, sum(&|a, _| (a - ma).powi(2)), sum(&|a, b| (a - ma) * (b - mb))]
    }

    #[test]
    fn halves_have_half_of_the_light_and_independent_noise() {
        for (electrons, read_noise_counts) in [(0.5, 1.5), (3.0, 1.5), (40.0, 1.5), (500.0, 0.0)] {
            let noise = SensorNoise { gain_counts: 0.5, read_noise_counts };
            let [mean, variance, covariance] = moments(electrons, &noise);
            let expected = 0.5 * (0.25 * electrons + read_noise_counts.powi(2));
            println!("{electrons} electrons: {mean:.3}, {variance:.3} of {expected:.3}, {covariance:.4}");
            assert!((mean - 0.25 * electrons).abs() < 4.0 * (expected / 2e5).sqrt(), "{electrons}: {mean}");
            assert!((variance / expected - 1.0).abs() < 0.02, "{electrons}: {variance} for {expected}");
            assert!(covariance.abs() < 0.02 * variance, "{electrons}: {covariance}");
        }
    }

    #[test]
    fn halves_add_up_and_repeat() {
        let noise = SensorNoise { gain_counts: 0.3, read_noise_counts: 2.0 };
        let light = Array2::from_shape_fn((20, 30), |(row, column)| (row * column) as f32 - 3.0);
        let [a, b] = thinned(&light, &noise, 1);
        assert!((&a + &b - &light).iter().all(|off| off.abs() < 1e-4));
        assert_eq!([a.clone(), b], thinned(&light, &noise, 1));
        assert_ne!(a, thinned(&light, &noise, 2)[0]);
    }
}
