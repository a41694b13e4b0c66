//! The normalised median test.

use super::fill::{neighbours, plane};
use glam::DVec3;
use lf_core::statistics::median;

/// The normalised median test (Westerweel & Scarano, Exp. Fluids, 2005) over the 26 neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MedianTest {
    /// Largest accepted ratio of a vector's residual to the median residual of its neighbours. The authors' value is 2.
    pub threshold: f64,
    /// Fluctuation of a good measurement along each axis, voxels. Without it the test would be too strict where
    /// neighbours agree. The default is the authors' 0.1 px, for a correlation peak of [`MedianTest::WIDTH_VOX`]; a
    /// wider peak raises it in proportion.
    pub tolerance_vox: [f64; 3],
}

impl Default for MedianTest {
    fn default() -> Self {
        Self { threshold: 2.0, tolerance_vox: [0.1; 3] }
    }
}

/// Constant: with fewer neighbours a median means nothing, and every vector passes.
const MIN_NEIGHBOURS: usize = 4;

impl MedianTest {
    /// Standard deviation of the correlation peak of ideal particle images of 0.75 voxel: 0.75 sqrt(2).
    pub const WIDTH_VOX: f64 = 0.75 * std::f64::consts::SQRT_2;

    /// Whether each vector fails the test against its measured neighbours. `None` is neither tested nor a neighbour.
    pub(crate) fn outliers(&self, shape: [usize; 3], vectors: &[Option<DVec3>]) -> Vec<bool> {
        let fails =
            |(node, vector): (usize, &Option<DVec3>)| vector.is_some_and(|v| !self.passes(shape, vectors, node, v));
        vectors.iter().enumerate().map(fails).collect()
    }

    /// Whether `vector` passes at `node`, either as it is or with the gradient of the neighbours subtracted.
    ///
    /// Departure: the authors have no second trial. At a field's edge all neighbours are on one side, and a uniform
    /// gradient of 0.3 voxel per node would fail the test there.
    pub(crate) fn passes(&self, shape: [usize; 3], vectors: &[Option<DVec3>], node: usize, vector: DVec3) -> bool {
        let agrees = |slope: [DVec3; 3]| {
            let moved = |(near, step): (usize, DVec3)| {
                Some(vectors[near]? - (slope[0] * step.x + slope[1] * step.y + slope[2] * step.z))
            };
            self.agrees(vector, &neighbours(shape, node).filter_map(moved).collect::<Vec<_>>())
        };
        agrees([DVec3::ZERO; 3]) || plane(shape, vectors, node).is_some_and(|plane| agrees(plane.slope))
    }

    /// The test against the vectors `near`.
    ///
    /// Equation, along each axis: `|u - median(u_i)| / (median |u_i - median(u_i)| + tolerance)` above the threshold.
    fn agrees(&self, vector: DVec3, near: &[DVec3]) -> bool {
        let agrees = |axis: usize| {
            let mut values: Vec<f64> = near.iter().map(|near| near[axis]).collect();
            let middle = median(&mut values);
            values.iter_mut().for_each(|value| *value = (*value - middle).abs());
            (vector[axis] - middle).abs() <= self.threshold * (median(&mut values) + self.tolerance_vox[axis])
        };
        near.len() < MIN_NEIGHBOURS || (0..3).all(agrees)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wrong_vector_is_found_and_a_gradient_is_not() {
        let shape = [5, 4, 3];
        let mut field: Vec<_> =
            (0..60).map(|k| Some(DVec3::new(0.3 * (k % 5) as f64, 0.1 * (k / 5 % 4) as f64, 2.0))).collect();
        assert!(!MedianTest::default().outliers(shape, &field).contains(&true));
        field[27] = Some(DVec3::new(0.6, 0.1, 3.0));
        let found = MedianTest::default().outliers(shape, &field);
        assert_eq!(found.iter().filter(|wrong| **wrong).count(), 1);
        assert!(found[27]);
    }

    #[test]
    fn by_hand_in_one_row() {
        // Five neighbours 1, 1, 2, 3, 3 about a node: median 2, median residual 1, so 2 + 2 (1 + 0.1) = 4.2 is the
        // limit.
        let near = [1.0, 2.0, 3.0, 1.0, 3.0].map(|u| u * DVec3::X);
        for (u, good) in [(4.19, true), (4.21, false), (-0.19, true), (-0.21, false)] {
            assert_eq!(MedianTest::default().agrees(u * DVec3::X, &near), good);
        }
    }
}
