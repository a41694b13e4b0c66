//! The normalised median test.

use super::{fill::plane, neighbours};
use glam::DVec3;
use lf_core::statistics::median;

/// The normalised median test (Westerweel & Scarano, Exp. Fluids 39, 2005) over the 26 neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MedianTest {
    /// Largest accepted residual over the neighbours' median residual. The authors' value is 2.
    pub threshold: f64,
    /// Fluctuation of a good measurement along each axis, voxels. It keeps a calm neighbourhood from being too strict.
    /// The default is the authors' 0.1 px, for a correlation peak of [`MedianTest::WIDTH_VOX`]. A wider peak raises it
    /// in proportion, axis by axis, as it raises the error of a good measurement.
    pub tolerance_vox: [f64; 3],
}

impl MedianTest {
    /// Standard deviation of the correlation peak of ideal particle images of 0.75 voxel: 0.75 sqrt(2).
    pub const WIDTH_VOX: f64 = 0.75 * std::f64::consts::SQRT_2;
}

impl Default for MedianTest {
    fn default() -> Self {
        Self { threshold: 2.0, tolerance_vox: [0.1; 3] }
    }
}

/// Constant: with fewer neighbours than this a median says nothing, and a vector is left as it is.
const FEWEST: usize = 4;

/// Whether each vector fails the test against its measured neighbours. `None` is neither tested nor a neighbour.
///
/// Equation, along each axis: `|u - median(u_i)| / (median |u_i - median(u_i)| + tolerance)` above the threshold.
pub(crate) fn outliers(shape: [usize; 3], vectors: &[Option<DVec3>], test: &MedianTest) -> Vec<bool> {
    let fails = |node: usize, vector: &Option<DVec3>| {
        vector.is_some_and(|vector| !passes_test(shape, vectors, node, vector, test))
    };
    vectors.iter().enumerate().map(|(node, vector)| fails(node, vector)).collect()
}

/// Whether `vector` would pass at `node`, either as it is or with the neighbours' own gradient taken out.
///
/// Departure: the authors have no second trial. At a field's edge all neighbours are on one side, and there a uniform
/// gradient of 0.3 voxel per node fails the test as printed.
pub(crate) fn passes_test(
    shape: [usize; 3],
    vectors: &[Option<DVec3>],
    node: usize,
    vector: DVec3,
    test: &MedianTest,
) -> bool {
    let flat = [DVec3::ZERO; 3];
    agrees(shape, vectors, node, vector, flat, test) || {
        let slope = plane(shape, vectors, node).map_or(flat, |plane| plane.slope);
        agrees(shape, vectors, node, vector, slope, test)
    }
}

/// The test against neighbours moved to the node along `slope`, the change of the vector per node along x, y, z.
fn agrees(
    shape: [usize; 3],
    vectors: &[Option<DVec3>],
    node: usize,
    vector: DVec3,
    slope: [DVec3; 3],
    test: &MedianTest,
) -> bool {
    let (mut moved, mut count) = ([DVec3::ZERO; 26], 0);
    neighbours::each(shape, node, |neighbour, step| {
        if let Some(near) = vectors[neighbour] {
            moved[count] = near - (slope[0] * step.x + slope[1] * step.y + slope[2] * step.z);
            count += 1;
        }
    });
    count < FEWEST
        || (0..3).all(|axis| {
            let mut values = moved.map(|vector| vector[axis]);
            let values = &mut values[..count];
            let middle = median(values);
            values.iter_mut().for_each(|value| *value = (*value - middle).abs());
            let usual = median(values);
            (vector[axis] - middle).abs() <= test.threshold * (usual + test.tolerance_vox[axis])
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wrong_vector_is_found_and_a_gradient_is_not() {
        let shape = [5, 4, 3];
        let mut field: Vec<_> =
            (0..60).map(|k| Some(DVec3::new(0.3 * (k % 5) as f64, 0.1 * (k / 5 % 4) as f64, 2.0))).collect();
        assert!(!outliers(shape, &field, &MedianTest::default()).contains(&true));
        field[27] = Some(DVec3::new(0.6, 0.1, 3.0));
        let found = outliers(shape, &field, &MedianTest::default());
        assert_eq!(found.iter().filter(|wrong| **wrong).count(), 1);
        assert!(found[27]);
    }

    #[test]
    fn by_hand_in_one_row() {
        // Five neighbours 1, 1, 2, 3, 3 about a node: median 2, median residual 1, so 2 + 2 (1 + 0.1) = 4.2 is the
        // limit.
        let shape = [3, 2, 1];
        let mut field: Vec<_> = [1.0, 0.0, 2.0, 3.0, 1.0, 3.0].map(|u| Some(u * DVec3::X)).into();
        for (u, good) in [(4.19, true), (4.21, false), (-0.19, true), (-0.21, false)] {
            field[1] = Some(u * DVec3::X);
            assert_eq!(agrees(shape, &field, 1, u * DVec3::X, [DVec3::ZERO; 3], &MedianTest::default()), good);
        }
    }
}
