//! The normal distribution, to the last digits: tables are made of it.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::sync::LazyLock;

/// The density.
pub fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / TAU.sqrt()
}

/// The distribution.
pub fn distribution(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// Beyond it the distribution is 0 or 1 to the last digit.
const END: f64 = 8.5;
/// Nodes of [`NODES`] for each standard deviation.
const PER_SIGMA: f64 = 64.0;

/// The distribution and the density from -END to END.
static NODES: LazyLock<Vec<[f64; 2]>> = LazyLock::new(|| {
    let count = (END * PER_SIGMA) as i32;
    let places = (-count..=count).map(|n| f64::from(n) / PER_SIGMA);
    places.map(|z| [distribution(z), density(z)]).collect()
});

/// The distribution, and its integral up to z, `z Phi(z) + phi(z)`, to 1e-12: by their series about the nearest node.
pub fn integrals(z: f64) -> [f64; 2] {
    if z.abs() > END {
        return if z > 0.0 { [1.0, z] } else { [0.0; 2] };
    }
    let n = ((z + END) * PER_SIGMA + 0.5) as usize;
    let [share, dense] = NODES[n];
    let at = n as f64 / PER_SIGMA - END;
    // Derivatives of the density are Hermite polynomials times the density.
    let (h, square) = (z - at, at * at);
    let hermite = [at, square - 1.0, at * (square - 3.0), square * (square - 6.0) + 3.0];
    let series = |parts: [f64; 4]| {
        let [a, b, c, d] = hermite;
        1.0 - h / parts[0] * (a - h / parts[1] * (b - h / parts[2] * (c - h / parts[3] * d)))
    };
    let distribution = share + dense * h * series([2.0, 3.0, 4.0, 5.0]);
    [distribution, z * distribution + dense * series([1.0, 2.0, 3.0, 4.0])]
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
        // At nodes and between them, and on both sides of the ends.
        for n in -2000..=2000 {
            let z = f64::from(n) * 0.004_33;
            let wanted = [distribution(z), z * distribution(z) + density(z)];
            let off = [0, 1].map(|k| (integrals(z)[k] - wanted[k]).abs());
            assert!(off[0] < 2e-15 && off[1] < 1e-12, "{z}: {off:?}");
        }
    }
}
