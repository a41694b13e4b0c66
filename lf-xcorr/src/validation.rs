//! The normalised median test.

use crate::fill::plane;
use crate::neighbours;
use crate::options::MedianTest;

/// Constant: with fewer neighbours than this a median says nothing, and a vector is left as it is.
const FEWEST: usize = 4;

/// Which vectors fail the test against their measured neighbours. `None` is neither tested nor a neighbour.
///
/// Equation, along each axis: `|u - median(u_i)| / (median |u_i - median(u_i)| + tolerance)` above the threshold.
pub(crate) fn outliers(shape: [usize; 3], vectors: &[Option<[f64; 3]>], test: &MedianTest) -> Vec<bool> {
    let fails = |node: usize, vector: &Option<[f64; 3]>| {
        vector.is_some_and(|vector| !passes(shape, vectors, node, vector, test))
    };
    vectors.iter().enumerate().map(|(node, vector)| fails(node, vector)).collect()
}

/// Whether `vector` would pass at `node`: as it is, or else with the neighbours' own gradient taken out.
///
/// Departure: the second trial is not the authors'. At a field's edge all neighbours are to one side, where a uniform
/// gradient of 0.3 voxel per node fails the test as printed.
pub(crate) fn passes(
    shape: [usize; 3],
    vectors: &[Option<[f64; 3]>],
    node: usize,
    vector: [f64; 3],
    test: &MedianTest,
) -> bool {
    let level = [[0.0; 3]; 3];
    if agrees(shape, vectors, node, vector, level, test) {
        return true;
    }
    let slope = plane(shape, vectors, node).map_or(level, |plane| plane.slope);
    agrees(shape, vectors, node, vector, slope, test)
}

/// The test against neighbours moved to the node along `slope`, the change of the vector per node along x, y, z.
fn agrees(
    shape: [usize; 3],
    vectors: &[Option<[f64; 3]>],
    node: usize,
    vector: [f64; 3],
    slope: [[f64; 3]; 3],
    test: &MedianTest,
) -> bool {
    (0..3).all(|axis| {
        let (mut values, mut count) = ([0.0; 26], 0);
        neighbours::each(shape, node, |neighbour, step| {
            if let Some(near) = vectors[neighbour] {
                values[count] = near[axis] - (0..3).map(|a| slope[a][axis] * step[a] as f64).sum::<f64>();
                count += 1;
            }
        });
        let values = &mut values[..count];
        if count < FEWEST {
            return true;
        }
        let middle = median(values);
        values.iter_mut().for_each(|value| *value = (*value - middle).abs());
        let usual = median(values);
        (vector[axis] - middle).abs() <= test.threshold * (usual + test.tolerance_vox[axis])
    })
}

/// The median; sorts `values`, which are finite and not empty.
fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len() % 2 == 1 { values[half] } else { 0.5 * (values[half - 1] + values[half]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wrong_vector_is_found_and_a_gradient_is_not() {
        let shape = [5, 4, 3];
        let mut field: Vec<_> = (0..60).map(|k| Some([0.3 * (k % 5) as f64, 0.1 * (k / 5 % 4) as f64, 2.0])).collect();
        assert!(!outliers(shape, &field, &MedianTest::default()).contains(&true));
        field[27] = Some([0.6, 0.1, 3.0]);
        let found = outliers(shape, &field, &MedianTest::default());
        assert_eq!(found.iter().filter(|wrong| **wrong).count(), 1);
        assert!(found[27]);
    }

    #[test]
    fn by_hand_in_one_row() {
        // Five neighbours 1, 1, 2, 3, 3 about a node: median 2, median residual 1, so 2 + 2 (1 + 0.1) = 4.2 is the limit.
        let shape = [3, 2, 1];
        let mut field: Vec<_> = [1.0, 0.0, 2.0, 3.0, 1.0, 3.0].map(|u| Some([u, 0.0, 0.0])).into();
        for (u, good) in [(4.19, true), (4.21, false), (-0.19, true), (-0.21, false)] {
            field[1] = Some([u, 0.0, 0.0]);
            assert_eq!(agrees(shape, &field, 1, [u, 0.0, 0.0], [[0.0; 3]; 3], &MedianTest::default()), good);
        }
    }
}
