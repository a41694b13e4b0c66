//! The normal distribution, to the last digits: tables are made of it, so it may be slow.

use std::f64::consts::TAU;

/// Beyond this the distribution is 0 or 1 to 16 digits.
const FAR: f64 = 8.5;

/// The density.
pub(super) fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / TAU.sqrt()
}

/// The distribution, by Marsaglia's series (2004): `1/2 + phi(z) (z + z^3/3 + z^5/(3 5) + ...)`.
pub(super) fn distribution(z: f64) -> f64 {
    if z.abs() > FAR {
        return if z > 0.0 { 1.0 } else { 0.0 };
    }
    let (mut sum, mut term, mut n) = (z, z, 1.0);
    while term.abs() > 1e-17 * sum.abs() {
        n += 2.0;
        term *= z * z / n;
        sum += term;
    }
    0.5 + sum * density(z)
}

/// The integral of the distribution up to z: `z Phi(z) + phi(z)`.
pub(super) fn ramp(z: f64) -> f64 {
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
        assert_eq!([distribution(9.0), distribution(-9.0)], [1.0, 0.0]);
        assert!((ramp(0.0) - 0.398_942_280_401_433).abs() < 1e-14 && (ramp(20.0) - 20.0).abs() < 1e-14);
    }
}
