//! Vectors from their neighbours: replacement of outliers, and the predictor of the next pass.

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

/// One round of (1, 2, 1) / 4 along each axis; an end has no neighbour beyond it and is left alone along that axis, so a
/// uniform gradient stays what it is. Expects no holes.
pub(crate) fn smooth(shape: [usize; 3], vectors: &mut [[f64; 3]]) {
    let stride = [1, shape[0], shape[0] * shape[1]];
    for axis in 0..3 {
        let before = vectors.to_vec();
        for (node, vector) in vectors.iter_mut().enumerate() {
            let place = node / stride[axis] % shape[axis];
            if place > 0 && place + 1 < shape[axis] {
                let (low, high) = (before[node - stride[axis]], before[node + stride[axis]]);
                *vector = std::array::from_fn(|a| 0.5 * before[node][a] + 0.25 * (low[a] + high[a]));
            }
        }
    }
}

/// A field of displacements between the nodes of a pass, in voxels.
#[derive(Debug, Clone)]
pub(crate) struct Predictor {
    shape: [usize; 3],
    first_vox: [f64; 3],
    step_vox: [f64; 3],
    vectors: Vec<[f64; 3]>,
}

impl Predictor {
    /// Fills every hole and smooths; `None` where no vector was measured.
    pub fn new(
        shape: [usize; 3],
        first_vox: [f64; 3],
        step_vox: [f64; 3],
        mut vectors: Vec<Option<[f64; 3]>>,
    ) -> Option<Self> {
        let holes = (0..vectors.len()).filter(|&node| vectors[node].is_none()).collect();
        fill(shape, &mut vectors, holes);
        let mut vectors = vectors.into_iter().collect::<Option<Vec<_>>>()?;
        smooth(shape, &mut vectors);
        Some(Self { shape, first_vox, step_vox, vectors })
    }

    /// The displacement at a place, trilinear between nodes and constant beyond the outermost, voxels.
    pub fn at(&self, place_vox: [f64; 3]) -> [f64; 3] {
        let place: [f64; 3] = std::array::from_fn(|a| {
            ((place_vox[a] - self.first_vox[a]) / self.step_vox[a]).clamp(0.0, (self.shape[a] - 1) as f64)
        });
        let mut vector = [0.0; 3];
        for corner in 0..8 {
            let up = [corner & 1, corner >> 1 & 1, corner >> 2];
            let low = place.map(f64::floor);
            let weight: f64 =
                (0..3).map(|a| if up[a] == 1 { place[a] - low[a] } else { 1.0 - place[a] + low[a] }).product();
            if weight > 0.0 {
                let [x, y, z] = std::array::from_fn(|a| low[a] as usize + up[a]);
                let near = self.vectors[x + self.shape[0] * (y + self.shape[1] * z)];
                (0..3).for_each(|a| vector[a] += weight * near[a]);
            }
        }
        vector
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_field_is_filled_smoothed_and_interpolated_into_itself() {
        let shape = [5, 4, 3];
        let truth = |x: f64, y: f64, z: f64| [1.0 + 0.2 * x - 0.1 * y, 0.3 * z, -2.0 + 0.05 * x];
        let mut field: Vec<_> =
            (0..60).map(|k| Some(truth((k % 5) as f64, (k / 5 % 4) as f64, (k / 20) as f64))).collect();
        for hole in [0, 13, 27, 32, 59] {
            field[hole] = None;
        }
        let predictor = Predictor::new(shape, [10.0; 3], [2.0, 3.0, 4.0], field).unwrap();
        let found = predictor.at([10.0 + 2.0 * 1.3, 10.0 + 3.0 * 2.6, 10.0 + 4.0 * 1.5]);
        let wanted = truth(1.3, 2.6, 1.5);
        (0..3).for_each(|a| assert!((found[a] - wanted[a]).abs() < 0.02, "{found:?} {wanted:?}"));
    }

    #[test]
    fn nothing_measured_predicts_nothing_and_far_holes_are_reached_in_rounds() {
        assert!(Predictor::new([2, 2, 1], [0.0; 3], [1.0; 3], vec![None; 4]).is_none());
        let mut row = vec![None; 6];
        row[0] = Some([1.0, 2.0, 3.0]);
        fill([6, 1, 1], &mut row, (1..6).collect());
        assert!(row.iter().all(|v| v.is_some_and(|v| (0..3).all(|a| (v[a] - (a + 1) as f64).abs() < 1e-9))));
        let mut apart = vec![Some([1.0; 3]), None, None];
        fill([3, 1, 1], &mut apart, vec![2]);
        assert_eq!(apart[2], None);
    }
}
