//! Outliers replaced from their neighbours.

use glam::{DVec3, IVec3};
use lf_core::linear;

/// The up to 26 neighbours of `node` in a field of `shape`, with the step to each: -1, 0 or 1 along each axis.
pub(crate) fn neighbours(shape: [usize; 3], node: usize) -> impl Iterator<Item = (usize, DVec3)> {
    let [nx, ny, nz] = shape.map(|n| n as i32);
    let node = node as i32;
    let place = IVec3::new(node % nx, node / nx % ny, node / nx / ny);
    let steps = (0..27).map(|k| IVec3::new(k % 3, k / 3 % 3, k / 9) - 1).filter(|step| *step != IVec3::ZERO);
    let is_inside = move |to: IVec3| to.cmpge(IVec3::ZERO).all() && to.cmplt(IVec3::new(nx, ny, nz)).all();
    let index = move |step: IVec3| (node + step.x + nx * (step.y + ny * step.z)) as usize;
    steps.filter(move |step| is_inside(place + step)).map(move |step| (index(step), step.as_dvec3()))
}

/// Fills every hole with the value of the least-squares plane through its neighbours. Large gaps are filled in rounds
/// from their border. A hole that no vector can reach stays `None`.
pub(crate) fn fill(shape: [usize; 3], vectors: &mut [Option<DVec3>], mut holes: Vec<usize>) {
    while !holes.is_empty() {
        let value = |&hole: &usize| Some((hole, plane(shape, vectors, hole)?.value));
        let given: Vec<_> = holes.iter().filter_map(value).collect();
        if given.is_empty() {
            return;
        }
        given.iter().for_each(|&(hole, vector)| vectors[hole] = Some(vector));
        holes.retain(|&hole| vectors[hole].is_none());
    }
}

/// The vectors with every hole filled; `None` if there is no vector at all.
pub(crate) fn filled(shape: [usize; 3], mut vectors: Vec<Option<DVec3>>) -> Option<Vec<DVec3>> {
    let holes = (0..vectors.len()).filter(|&node| vectors[node].is_none()).collect();
    fill(shape, &mut vectors, holes);
    vectors.into_iter().collect()
}

/// A plane through the neighbours of a node: its value at the node, and its change per node along x, y, z.
pub(crate) struct FittedPlane {
    pub value: DVec3,
    pub slope: [DVec3; 3],
}

/// The least-squares plane through the neighbours of `node`; `None` if it has no neighbour.
pub(crate) fn plane(shape: [usize; 3], vectors: &[Option<DVec3>], node: usize) -> Option<FittedPlane> {
    // Constant: the ridge makes the slope zero along an axis that the neighbours do not determine. At an edge it
    // reduces the slope by a few per cent, so that repeated extrapolation does not grow.
    const RIDGE: f64 = 0.1;
    let (mut matrix, mut right) = ([0.0; 16], [DVec3::ZERO; 4]);
    for (neighbour, step) in neighbours(shape, node) {
        let Some(vector) = vectors[neighbour] else { continue };
        // Weigh a neighbour by one over the square of its distance.
        let row = [1.0, step.x, step.y, step.z];
        let weight = 1.0 / step.length_squared();
        for i in 0..4 {
            (0..4).for_each(|j| matrix[4 * i + j] += weight * row[i] * row[j]);
            right[i] += weight * row[i] * vector;
        }
    }
    (1..4).for_each(|i| matrix[5 * i] += RIDGE);
    linear::cholesky(&mut matrix, 4, 0.0)?;
    let components = [0, 1, 2].map(|c| {
        let mut plane = right.map(|right| right[c]);
        linear::solve(&matrix, &mut plane);
        plane
    });
    let [value, slope @ ..] = [0, 1, 2, 3].map(|i| DVec3::from_array(components.map(|plane| plane[i])));
    Some(FittedPlane { value, slope })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_holes_are_reached_in_rounds() {
        let mut row = vec![None; 6];
        row[0] = Some(DVec3::new(1.0, 2.0, 3.0));
        fill([6, 1, 1], &mut row, (1..6).collect());
        assert!(row.iter().all(|v| v.is_some_and(|v| (0..3).all(|a| (v[a] - (a + 1) as f64).abs() < 1e-9))));
        let mut apart = vec![Some(DVec3::ONE), None, None];
        fill([3, 1, 1], &mut apart, vec![2]);
        assert_eq!(apart[2], None);
    }
}
