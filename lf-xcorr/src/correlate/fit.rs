//! The place of a correlation peak to a fraction of a voxel.
//!
//! Gaussian particle images correlate into a Gaussian, so the logarithm of the score around its peak is a quadratic in
//! three dimensions. Cross terms are included: a particle stretched along a line of sight that is not the z axis has a
//! tilted peak, which three one-dimensional fits would misplace.

use glam::DVec3;
use lf_core::linear::{cholesky, solve};

/// Constant: an axis is fitted over two shifts each way, not one, if the score two shifts off on both sides is above
/// this fraction of the peak. Particles long along z have a broad peak, whose neighbours differ by less than noise.
const BROAD: f64 = 0.6;

/// A Gaussian through a correlation peak.
#[derive(Debug)]
pub(crate) struct GaussianFit {
    /// Place of the top from the whole shift, voxels.
    pub offset: DVec3,
    /// Score at the top.
    pub height: f64,
    /// Covariance, voxels squared. A diagonal entry is infinite if three points along that axis show no peak.
    pub covariance: [[f64; 3]; 3],
}

/// The peak at the whole shift `at` of a box of `n` shifts; `at` is not on the box's edge.
///
/// Method: a least-squares quadratic through the logarithms, weighted with the square of the score, because the error
/// of a logarithm is the error of the score over the score. The offset is within one voxel of `at` along each axis. If
/// the neighbours do not form a peak, the fit takes three points per axis. Promise: a score that is equal at +d and -d
/// gives an offset of exactly zero.
pub(crate) fn gaussian(score: &[f64], n: [usize; 3], at: [usize; 3]) -> GaussianFit {
    let get = |d: [i32; 3]| {
        let is_inside = (0..3).all(|a| at[a] as i32 + d[a] >= 0 && at[a] as i32 + d[a] < n[a] as i32);
        let [x, y, z] = std::array::from_fn(|a| (at[a] as i32 + d[a]) as usize);
        if is_inside { score[x + n[0] * (y + n[1] * z)] } else { 0.0 }
    };
    let top = get([0; 3]);
    let reach: [i32; 3] = std::array::from_fn(|axis| {
        let off = |d: i32| get(along(axis, d));
        if off(-2).min(off(2)) > BROAD * top { 2 } else { 1 }
    });
    let fitted = quadratic(get, top, reach).and_then(vertex);
    let (offset, gain, covariance) = fitted.unwrap_or_else(|| three_points_per_axis(get, top));
    GaussianFit { offset: offset.into(), height: top * gain.exp(), covariance }
}

fn along(axis: usize, d: i32) -> [i32; 3] {
    std::array::from_fn(|a| if a == axis { d } else { 0 })
}

/// Number of terms of the quadratic. The first `EVEN` keep their sign under d -> -d, the others change it.
const TERMS: usize = 10;
const EVEN: usize = 7;

fn terms([x, y, z]: [f64; 3]) -> [f64; TERMS] {
    [1.0, x * x, y * y, z * z, x * y, x * z, y * z, x, y, z]
}

/// The terms by weighted normal equations; `None` if too few points have weight. Points are taken in opposite pairs, so
/// that the odd terms of a symmetric peak are exactly zero.
fn quadratic(get: impl Fn([i32; 3]) -> f64, top: f64, reach: [i32; 3]) -> Option<[f64; TERMS]> {
    let weight_and_value = |d: [i32; 3]| {
        let share = get(d) / top;
        if share > 0.0 { (share * share, share * share * share.ln()) } else { (0.0, 0.0) }
    };
    let (mut matrix, mut right) = ([0.0; TERMS * TERMS], [0.0; TERMS]);
    // The peak itself has weight 1 and logarithm 0.
    matrix[0] = 1.0;
    for z in 0..=reach[2] {
        for y in if z == 0 { 0 } else { -reach[1] }..=reach[1] {
            for x in if z == 0 && y == 0 { 1 } else { -reach[0] }..=reach[0] {
                let (plus, minus) = (weight_and_value([x, y, z]), weight_and_value([-x, -y, -z]));
                let row = terms([x as f64, y as f64, z as f64]);
                let weight = [plus.0 + minus.0, plus.0 - minus.0];
                let value = [plus.1 + minus.1, plus.1 - minus.1];
                for i in 0..TERMS {
                    for j in 0..=i {
                        matrix[TERMS * i + j] += row[i] * row[j] * weight[((i < EVEN) != (j < EVEN)) as usize];
                    }
                    right[i] += row[i] * value[(i >= EVEN) as usize];
                }
            }
        }
    }
    cholesky(&mut matrix, TERMS, 1e-10)?;
    solve(&matrix, &mut right);
    right.iter().all(|value| value.is_finite()).then_some(right)
}

/// Place of the top, the logarithm of its height over the score at the whole shift, and the covariance.
type Top = ([f64; 3], f64, [[f64; 3]; 3]);

/// The top of the quadratic; `None` if it has none within a voxel.
fn vertex(c: [f64; TERMS]) -> Option<Top> {
    // Minus the Hessian is positive definite if its leading minors are positive.
    let [xx, yy, zz] = [1, 2, 3].map(|i| -2.0 * c[i]);
    let [xy, xz, yz] = [4, 5, 6].map(|i| -c[i]);
    let [x, y, z] = [c[7], c[8], c[9]];
    let minor = xx * yy - xy * xy;
    let [cx, cy, cz] = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
    let determinant = xx * cx + xy * cy + xz * cz;
    if !(xx > 0.0 && minor > 0.0 && determinant > 0.0) {
        return None;
    }
    let covariance = [[cx, cy, cz], [cy, xx * zz - xz * xz, xy * xz - xx * yz], [cz, xy * xz - xx * yz, minor]]
        .map(|row| row.map(|cofactor| cofactor / determinant));
    let offset = covariance.map(|row| row[0] * x + row[1] * y + row[2] * z);
    let gain = 0.5 * (offset[0] * x + offset[1] * y + offset[2] * z);
    offset.iter().all(|o| o.abs() <= 1.0).then_some((offset, gain, covariance))
}

/// A Gaussian through three points per axis; a parabola if one of them is not positive.
fn three_points_per_axis(get: impl Fn([i32; 3]) -> f64, top: f64) -> Top {
    let (mut gain, mut covariance) = (0.0, [[0.0; 3]; 3]);
    (0..3).for_each(|axis| covariance[axis][axis] = f64::INFINITY);
    let offset = std::array::from_fn(|axis| {
        let off = |d: i32| get(along(axis, d)) / top;
        let is_gaussian = off(-1) > 0.0 && off(1) > 0.0;
        let [before, after] = [-1, 1].map(|d| if is_gaussian { off(d).ln() } else { off(d) - 1.0 });
        let curve = before + after;
        if curve >= 0.0 {
            return 0.0;
        }
        let offset = (before - after) / (2.0 * curve);
        gain += 0.25 * (after - before) * offset;
        covariance[axis][axis] = -curve.recip();
        offset
    });
    (offset, gain, covariance)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: [usize; 3] = [7, 7, 7];

    /// A box of exp(-q / 2) around (3, 3, 3) + `offset`.
    fn peak(offset: [f64; 3], q: impl Fn([f64; 3]) -> f64) -> Vec<f64> {
        let place = |k: usize| [k % 7, k / 7 % 7, k / 49];
        (0..343).map(|k| (-0.5 * q(std::array::from_fn(|a| place(k)[a] as f64 - 3.0 - offset[a]))).exp()).collect()
    }

    #[test]
    fn a_gaussian_is_found_exactly_round_long_and_tilted() {
        let offset = [0.3, -0.41, 0.17];
        let round = |d: [f64; 3]| d.iter().map(|d| d * d / 1.1).sum::<f64>();
        let long = |d: [f64; 3]| (d[0] * d[0] + d[1] * d[1]) / 1.1 + d[2] * d[2] / 32.0;
        let tilted = |d: [f64; 3]| (d[0] * d[0] + d[1] * d[1]) / 1.1 + d[2] * d[2] / 4.0 + 0.3 * d[0] * d[2];
        for score in [peak(offset, round), peak(offset, long), peak(offset, tilted)] {
            let found = gaussian(&score, N, [3; 3]);
            (0..3).for_each(|a| assert!((found.offset[a] - offset[a]).abs() < 1e-9, "{found:?}"));
            assert!((found.height - 1.0).abs() < 1e-9, "{found:?}");
        }
        // By hand: the inverse of [[1 / 1.1, 0.15], [0.15, 0.25]] in x and z.
        let covariance = gaussian(&peak(offset, tilted), N, [3; 3]).covariance;
        let determinant = 0.25 / 1.1 - 0.15 * 0.15;
        for (i, j, wanted) in [(0, 0, 0.25 / determinant), (0, 2, -0.15 / determinant), (1, 1, 1.1), (0, 1, 0.0)] {
            assert!((covariance[i][j] - wanted).abs() < 1e-8, "{covariance:?}");
        }
    }

    #[test]
    fn a_symmetric_peak_stays_exactly_where_it_is() {
        let rough = |d: [f64; 3]| d[0] * d[0] + 0.7 * d[1] * d[1] + 0.1 * d[2].abs() + (d[0] * d[1] * 3.0).cos();
        assert_eq!(gaussian(&peak([0.0; 3], rough), N, [3; 3]).offset, DVec3::ZERO);
    }

    #[test]
    fn neighbours_without_light_fall_back_to_three_points() {
        let mut score = vec![0.0; 343];
        score[3 + 7 * (3 + 7 * 3)] = 0.8;
        score[4 + 7 * (3 + 7 * 3)] = 0.4;
        let GaussianFit { offset, height, .. } = gaussian(&score, N, [3; 3]);
        // By hand: a parabola through (-1, 0), (0, 1), (1, 1/2) has its top at 1/6.
        assert!((offset[0] - 1.0 / 6.0).abs() < 1e-12 && offset[1] == 0.0 && offset[2] == 0.0, "{offset:?}");
        assert!(height > 0.8);
    }
}
