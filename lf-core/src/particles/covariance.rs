//! The covariance of a line, checked.

use glam::{DMat3, DVec3};

/// Tolerance of the checks, as a correlation: numbers in a table are rounded.
const ROUNDING: f64 = 1e-5;
/// Largest relative difference between a standard uncertainty and the root of its variance.
const SAME: f64 = 0.01;

/// The matrix of cxx, cxy, cxz, cyy, cyz, czz.
pub(super) fn matrix([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> DMat3 {
    DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
}

/// cxx, cxy, cxz, cyy, cyz, czz.
pub(super) fn upper(matrix: &DMat3) -> [f64; 6] {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    [x.x, y.x, z.x, y.y, z.y, z.z]
}

/// The first reason to refuse a covariance and the standard uncertainties given with it.
pub(super) fn fault(matrix: &DMat3, std: DVec3) -> Option<String> {
    let variance = matrix.diagonal();
    if variance.min_element() < 0.0 {
        return Some("has a negative variance".to_owned());
    }
    for axis in 0..3 {
        let (given, root) = (std[axis], variance[axis].sqrt());
        if (given - root).abs() > SAME * root.max(given) {
            let name = ["x", "y", "z"][axis];
            return Some(format!("has s{name}_mm {given}, and {root:.4e} by its covariance"));
        }
    }
    let scale = variance.map(|variance| if variance > 0.0 { variance.sqrt().recip() } else { 0.0 });
    let correlation = |a: usize, b: usize| matrix.col(b)[a] * scale[a] * scale[b];
    let [xy, xz, yz] = [correlation(0, 1), correlation(0, 2), correlation(1, 2)];
    // A variable with variance 0 cannot have a covariance.
    let is_lost = |a: usize, b: usize| matrix.col(b)[a] != 0.0 && scale[a] * scale[b] == 0.0;
    let is_definite = [xy, xz, yz].iter().all(|pair| pair.abs() <= 1.0 + ROUNDING)
        && 1.0 + 2.0 * xy * xz * yz - xy * xy - xz * xz - yz * yz >= -ROUNDING;
    let is_fit = is_definite && !is_lost(0, 1) && !is_lost(0, 2) && !is_lost(1, 2);
    (!is_fit).then(|| "has a covariance that is not positive semidefinite".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_semidefinite_matrices_pass() {
        let fault = |upper: [f64; 6]| {
            let matrix = matrix(upper);
            super::fault(&matrix, matrix.diagonal().map(|variance| variance.max(0.0).sqrt()))
        };
        for fit in
            [[0.0; 6], [1.0, 0.0, 0.0, 1.0, 0.0, 1.0], [1.0, 2.0, 3.0, 4.0, 6.0, 9.0], [4.0, 0.0, 1.9, 0.0, 0.0, 1.0]]
        {
            assert_eq!(fault(fit), None, "{fit:?}");
        }
        for wrong in [
            [-1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            [1.0, 1.1, 0.0, 1.0, 0.0, 1.0],
            [0.0, 0.1, 0.0, 1.0, 0.0, 1.0],
            // Each pair may correlate by 0.9, but not with these signs.
            [1.0, 0.9, 0.9, 1.0, -0.9, 1.0],
        ] {
            assert!(fault(wrong).is_some(), "{wrong:?}");
        }
        assert_eq!(upper(&matrix([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }

    #[test]
    fn standard_uncertainties_must_agree() {
        let found = fault(&matrix([4.0, 0.0, 0.0, 1.0, 0.0, 1.0]), DVec3::new(2.1, 1.0, 1.0)).unwrap();
        assert_eq!(found, "has sx_mm 2.1, and 2.0000e0 by its covariance");
    }
}
