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

/// The integral of the distribution up to z: `z Phi(z) + phi(z)`.
pub fn ramp(z: f64) -> f64 {
    z * distribution(z) + density(z)
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
        assert!(distribution(9.0) == 1.0 && (distribution(-9.0) / 1.128_588e-19 - 1.0).abs() < 1e-6);
        assert!((ramp(0.0) - 0.398_942_280_401_433).abs() < 1e-14 && (ramp(20.0) - 20.0).abs() < 1e-14);
    }
}
