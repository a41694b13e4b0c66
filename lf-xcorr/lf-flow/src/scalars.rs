//! Scalars of a velocity gradient: strength of strain and rotation, and criteria for vortices.
//!
//! Convention: column j of a gradient is the derivative of (u, v, w) along axis j.

use glam::{DMat3, DVec3};

/// The symmetric part, the strain rate.
pub(super) fn strain(gradient: &DMat3) -> DMat3 {
    0.5 * (*gradient + gradient.transpose())
}

/// The skew part.
fn spin(gradient: &DMat3) -> DMat3 {
    0.5 * (*gradient - gradient.transpose())
}

/// Sum of the squares of the entries.
fn square(matrix: &DMat3) -> f64 {
    matrix.to_cols_array().iter().map(|entry| entry * entry).sum()
}

/// Curl of the velocity.
pub(super) fn vorticity(gradient: &DMat3) -> DVec3 {
    let [x, y, z] = [gradient.x_axis, gradient.y_axis, gradient.z_axis];
    DVec3::new(y.z - z.y, z.x - x.z, x.y - y.x)
}

/// Divergence of the velocity.
pub(super) fn divergence(gradient: &DMat3) -> f64 {
    gradient.x_axis.x + gradient.y_axis.y + gradient.z_axis.z
}

/// Strength of the strain rate S, `sqrt(2 S:S)`.
pub(super) fn shear(gradient: &DMat3) -> f64 {
    (2.0 * square(&strain(gradient))).sqrt()
}

/// Q of Hunt, Wray & Moin (1988): half of spin squared less strain squared; above 0 in a vortex.
pub(super) fn q_criterion(gradient: &DMat3) -> f64 {
    0.5 * (square(&spin(gradient)) - square(&strain(gradient)))
}

/// Lambda-2 of Jeong & Hussain (J. Fluid Mech., 1995): the middle eigenvalue of `S^2 + W^2`; below 0 in a vortex.
pub(super) fn lambda_2(gradient: &DMat3) -> f64 {
    let (strain, spin) = (strain(gradient), spin(gradient));
    middle_eigenvalue(&(strain * strain + spin * spin))
}

/// Swirling strength of Zhou et al. (J. Fluid Mech., 1999): the imaginary part of the complex eigenvalues, 0 if all
/// are real.
pub(super) fn swirl(gradient: &DMat3) -> f64 {
    // The characteristic polynomial about a third of the trace: t^3 + p t + q.
    let trace = divergence(gradient);
    let product = *gradient * *gradient;
    let second = 0.5 * (trace * trace - divergence(&product));
    let p = second - trace * trace / 3.0;
    let q = trace * second / 3.0 - 2.0 * trace.powi(3) / 27.0 - gradient.determinant();
    let root = (0.5 * q).powi(2) + (p / 3.0).powi(3);
    if root <= 0.0 {
        return 0.0;
    }
    let root = root.sqrt();
    0.75f64.sqrt() * ((root - 0.5 * q).cbrt() - (-root - 0.5 * q).cbrt())
}

/// Middle eigenvalue of a symmetric matrix, by the angle of its characteristic polynomial (Smith 1961).
fn middle_eigenvalue(matrix: &DMat3) -> f64 {
    let mean = divergence(matrix) / 3.0;
    let rest = *matrix - DMat3::from_diagonal(DVec3::splat(mean));
    let size = (square(&rest) / 6.0).sqrt();
    if size == 0.0 {
        return mean;
    }
    let angle = (0.5 * rest.determinant() / size.powi(3)).clamp(-1.0, 1.0).acos() / 3.0;
    mean - size * (angle.cos() - 3f64.sqrt() * angle.sin())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(rate: DVec3) -> DMat3 {
        DMat3::from_cols(rate.cross(DVec3::X), rate.cross(DVec3::Y), rate.cross(DVec3::Z))
    }

    #[test]
    fn a_rotation_is_a_vortex_by_every_criterion() {
        let rate = DVec3::new(0.1, -0.2, 0.4);
        let gradient = turn(rate);
        let square = rate.length_squared();
        assert!((vorticity(&gradient) - 2.0 * rate).length() < 1e-12);
        assert!((q_criterion(&gradient) - square).abs() < 1e-12 && shear(&gradient) < 1e-12);
        assert!((lambda_2(&gradient) + square).abs() < 1e-9, "{}", lambda_2(&gradient));
        assert!((swirl(&gradient) - rate.length()).abs() < 1e-9);
    }

    #[test]
    fn strain_and_shear_are_no_vortices() {
        let stretch = DMat3::from_diagonal(DVec3::new(0.3, -0.1, -0.2));
        assert!((q_criterion(&stretch) + 0.5 * 0.14).abs() < 1e-12 && swirl(&stretch) == 0.0);
        assert!((lambda_2(&stretch) - 0.04).abs() < 1e-9 && divergence(&stretch).abs() < 1e-12);
        let layer = DMat3::from_cols(DVec3::ZERO, DVec3::X * 0.2, DVec3::ZERO);
        assert!((shear(&layer) - 0.2).abs() < 1e-12 && q_criterion(&layer).abs() < 1e-12);
        assert!(swirl(&layer).abs() < 1e-6 && lambda_2(&layer).abs() < 1e-9);
    }

    /// Eigenvalues 0.5 and -0.1 +- 0.3 i, in axes that are turned.
    #[test]
    fn a_stretched_vortex_has_the_swirl_of_its_eigenvalues() {
        let core = DMat3::from_cols(DVec3::new(-0.1, 0.3, 0.0), DVec3::new(-0.3, -0.1, 0.0), DVec3::Z * 0.5);
        let axes = DMat3::from_rotation_x(0.7) * DMat3::from_rotation_z(-1.1);
        assert!((swirl(&(axes * core * axes.transpose())) - 0.3).abs() < 1e-9);
    }
}
