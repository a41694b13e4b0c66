//! The normal distribution, to the last digits: tables are made of it.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// The density.
pub fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / TAU.sqrt()
}

/// The distribution.
pub fn distribution(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// The distribution, and its integral up to z, `z Phi(z) + phi(z)`.
pub fn integrals(z: f64) -> [f64; 2] {
    // All digits of what is left beyond are lost.
    if z.abs() > 8.5 {
        return if z > 0.0 { [1.0, z] } else { [0.0; 2] };
    }
    let distribution = distribution(z);
    [distribution, z * distribution + density(z)]
}

/// The distribution and the density in single precision, to 3e-7 and 1e-5: Abramowitz and Stegun 7.1.28 and its
/// derivative. It has no branch, so that the compiler does it for eight numbers at once.
#[inline(always)]
pub fn quick_distribution(z: f32) -> (f32, f32) {
    const A: [f32; 6] = [0.070_523_08, 0.042_282_01, 0.009_270_527, 0.000_152_014_3, 0.000_276_567_2, 0.000_043_063_8];
    let x = (z.abs() * std::f32::consts::FRAC_1_SQRT_2).min(6.0);
    let level = 1.0 + x * (A[0] + x * (A[1] + x * (A[2] + x * (A[3] + x * (A[4] + x * A[5])))));
    let slope = A[0] + x * (2.0 * A[1] + x * (3.0 * A[2] + x * (4.0 * A[3] + x * (5.0 * A[4] + x * (6.0 * A[5])))));
    let inverse = 1.0 / level;
    let second = inverse * inverse;
    let fourth = second * second;
    let eighth = fourth * fourth;
    let beyond = 0.5 * eighth * eighth;
    let share = if z > 0.0 { 1.0 - beyond } else { beyond };
    (share, 16.0 * beyond * inverse * slope * std::f32::consts::FRAC_1_SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From tables of the normal distribution.
    #[test]
    fn the_distribution_is_that_of_the_tables() {
        for (z, phi) in
            [(0.0, 0.5), (1.0, 0.841_344_746_068_543), (-2.0, 0.022_750_131_948_179), (4.0, 0.999_968_328_758)]
        {
            assert!((distribution(z) - phi).abs() < 1e-12, "{z}: {}", distribution(z));
        }
        for z in [-4.0, -1.3, 0.0, 0.4, 2.5] {
            let (share, dense) = quick_distribution(z);
            let off = [f64::from(share) - distribution(z.into()), f64::from(dense) - density(z.into())];
            assert!(off[0].abs() < 4e-7 && off[1].abs() < 2e-5, "{z}: {off:?}");
        }
        assert!(distribution(9.0) == 1.0 && (distribution(-9.0) / 1.128_588e-19 - 1.0).abs() < 1e-6);
        assert!((integrals(0.0)[1] - 0.398_942_280_401_433).abs() < 1e-14);
        // Beyond the last digits nothing is computed, and nothing jumps there.
        for z in [-8.5f64, 8.5] {
            let [inner, outer] = [integrals(z * (1.0 - 1e-15)), [f64::from(z > 0.0), z.max(0.0)]];
            assert!((inner[0] - outer[0]).abs() < 1e-15 && (inner[1] - outer[1]).abs() < 1.1e-14, "{z}");
        }
    }
}
