//! Vectors from their neighbours: the replacement of outliers.

use crate::neighbours;

/// Gives every hole that has neighbours a vector: the plane through them, by least squares. Holes inside a large gap take
/// the vectors given in the round before. What no vector can reach stays `None`.
pub(crate) fn fill(shape: [usize; 3], vectors: &mut [Option<[f64; 3]>], mut holes: Vec<usize>) {
    while !holes.is_empty() {
        let given: Vec<_> =
            holes.iter().filter_map(|&hole| plane(shape, vectors, hole).map(|plane| (hole, plane.value))).collect();
        if given.is_empty() {
            return;
        }
        given.iter().for_each(|&(hole, vector)| vectors[hole] = Some(vector));
        holes.retain(|&hole| vectors[hole].is_none());
    }
}

/// The vectors with every hole filled; `None` where there is nothing to fill from.
pub(crate) fn filled(shape: [usize; 3], mut vectors: Vec<Option<[f64; 3]>>) -> Option<Vec<[f64; 3]>> {
    let holes = (0..vectors.len()).filter(|&node| vectors[node].is_none()).collect();
    fill(shape, &mut vectors, holes);
    vectors.into_iter().collect()
}

/// The plane through the neighbours of a node, by least squares.
pub(crate) struct Plane {
    /// Its value at the node.
    pub value: [f64; 3],
    /// Its slope per node along x, y, z, of each component.
    pub slope: [[f64; 3]; 3],
}

/// The plane through the neighbours of `node`; `None` where it has none.
pub(crate) fn plane(shape: [usize; 3], vectors: &[Option<[f64; 3]>], node: usize) -> Option<Plane> {
    // Constant: the ridge holds the slope at zero along an axis whose neighbours do not tell it. Where they surround the node
    // it changes nothing; at an edge it holds back a few per cent of the slope, so that rounds of extrapolation stay tame.
    const RIDGE: f64 = 0.1;
    let (mut matrix, mut right) = ([[0.0; 4]; 4], [[0.0; 3]; 4]);
    let mut count = 0;
    neighbours::each(shape, node, |neighbour, step| {
        if let Some(vector) = vectors[neighbour] {
            count += 1;
            // Nearer neighbours count for more: the weight is one over the square of the distance.
            let row = [1.0, step[0] as f64, step[1] as f64, step[2] as f64];
            let weight = 1.0 / (step[0] * step[0] + step[1] * step[1] + step[2] * step[2]) as f64;
            for i in 0..4 {
                (0..4).for_each(|j| matrix[i][j] += weight * row[i] * row[j]);
                (0..3).for_each(|axis| right[i][axis] += weight * row[i] * vector[axis]);
            }
        }
    });
    if count == 0 {
        return None;
    }
    (1..4).for_each(|i| matrix[i][i] += RIDGE);
    // Eliminate the slopes upwards, then substitute downwards; the matrix is positive definite.
    for i in (1..4).rev() {
        for j in 0..i {
            let share = matrix[j][i] / matrix[i][i];
            (0..4).for_each(|k| matrix[j][k] -= share * matrix[i][k]);
            (0..3).for_each(|axis| right[j][axis] -= share * right[i][axis]);
        }
    }
    for i in 0..4 {
        for axis in 0..3 {
            let known: f64 = (0..i).map(|j| matrix[i][j] * right[j][axis]).sum();
            right[i][axis] = (right[i][axis] - known) / matrix[i][i];
        }
    }
    Some(Plane { value: right[0], slope: [right[1], right[2], right[3]] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_holes_are_reached_in_rounds() {
        let mut row = vec![None; 6];
        row[0] = Some([1.0, 2.0, 3.0]);
        fill([6, 1, 1], &mut row, (1..6).collect());
        assert!(row.iter().all(|v| v.is_some_and(|v| (0..3).all(|a| (v[a] - (a + 1) as f64).abs() < 1e-9))));
        let mut apart = vec![Some([1.0; 3]), None, None];
        fill([3, 1, 1], &mut apart, vec![2]);
        assert_eq!(apart[2], None);
    }
}
