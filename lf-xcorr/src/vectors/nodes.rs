//! The nodes of a vector field, and values between them.

use glam::DVec3;
use lf_core::field::Cell;

/// Nodes on a regular grid, x fastest; places are in any one unit of length.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nodes {
    pub shape: [usize; 3],
    pub first: DVec3,
    pub step: DVec3,
}

impl Nodes {
    /// Constant: at 75 % overlap the outermost windows reach two nodes beyond their centres.
    const BEYOND: f64 = 2.0;

    /// The value at a place: trilinear between nodes. Beyond the outermost nodes the gradient continues for up to
    /// [`Nodes::BEYOND`] nodes; farther out the value is constant.
    pub fn at(&self, vectors: &[DVec3], place: DVec3) -> DVec3 {
        let Cell { corner, stride, fraction } = self.cell(place, Self::BEYOND);
        let mix = |from: DVec3, to: DVec3, fraction: f64| from + fraction * (to - from);
        let along_x = |corner: usize| mix(vectors[corner], vectors[corner + stride[0]], fraction[0]);
        let along_y = |corner: usize| mix(along_x(corner), along_x(corner + stride[1]), fraction[1]);
        mix(along_y(corner), along_y(corner + stride[2]), fraction[2])
    }

    /// The value at a place by cubic convolution (Keys 1981), which follows curved fields better than [`Nodes::at`]
    /// between nodes. Beyond the outermost nodes the gradient continues as in [`Nodes::at`].
    pub fn curved_at(&self, vectors: &[DVec3], place: DVec3) -> DVec3 {
        let Cell { corner, fraction, .. } = self.cell(place, Self::BEYOND);
        let (steps, weights) = (self.steps(corner), fraction.map(cubic));
        let row = |j: i64, k: i64| -> DVec3 {
            (0..4).map(|i| weights[0][i] * self.continued(vectors, [steps[0] as i64 + i as i64 - 1, j, k], 0)).sum()
        };
        let plane = |k: i64| (0..4).map(|j| weights[1][j] * row(steps[1] as i64 + j as i64 - 1, k)).sum::<DVec3>();
        (0..4).map(|k| weights[2][k] * plane(steps[2] as i64 + k as i64 - 1)).sum()
    }

    /// The value at a node. Outside the grid it continues along straight lines, axis by axis.
    fn continued(&self, vectors: &[DVec3], node: [i64; 3], axis: usize) -> DVec3 {
        if axis == 3 {
            return vectors[self.index(node.map(|step| step as usize))];
        }
        let last = self.shape[axis] as i64 - 1;
        let inside = node[axis].clamp(0, last);
        let at = |step: i64| {
            let mut node = node;
            node[axis] = step;
            self.continued(vectors, node, axis + 1)
        };
        let beyond = node[axis] - inside;
        match beyond {
            0 => at(inside),
            _ if last == 0 => at(0),
            _ => at(inside) + beyond.abs() as f64 * (at(inside) - at(inside - beyond.signum())),
        }
    }

    /// The nodes around a place and their trilinear weights, which add up to 1. A place outside counts as on the
    /// border.
    pub fn shares(&self, place: DVec3) -> [(usize, f64); 8] {
        self.cell(place, 0.0).corners()
    }

    /// The place of a node.
    pub fn place(&self, node: usize) -> DVec3 {
        self.first + self.step * DVec3::from_array(self.steps(node).map(|step| step as f64))
    }

    /// The indices of a node along x, y, z.
    pub fn steps(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.shape;
        [node % nx, node / nx % ny, node / nx / ny]
    }

    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.shape[0] * (j + self.shape[1] * k)
    }

    pub fn count(&self) -> usize {
        self.shape.iter().product()
    }

    /// The nodes at most `reach` steps from a node along each axis, x fastest.
    pub fn around(&self, node: usize, reach: usize) -> impl Iterator<Item = [usize; 3]> + use<> {
        let steps = self.steps(node);
        let [x, y, z] =
            [0, 1, 2].map(|axis| steps[axis].saturating_sub(reach)..(steps[axis] + reach + 1).min(self.shape[axis]));
        let rows = z.flat_map(move |k| y.clone().map(move |j| (j, k)));
        rows.flat_map(move |(j, k)| x.clone().map(move |i| [i, j, k]))
    }

    /// Nodes about `distance` apart: every n-th one, with the remainder split evenly between both ends.
    pub fn apart(&self, distance: DVec3) -> Self {
        let skip = (distance / self.step).round().to_array().map(|steps| (steps as usize).max(1));
        let count = [0, 1, 2].map(|axis| (self.shape[axis] - 1) / skip[axis] + 1);
        let first = [0, 1, 2].map(|axis| (self.shape[axis] - 1 - (count[axis] - 1) * skip[axis]) / 2);
        let step = self.step * DVec3::from_array(skip.map(|skip| skip as f64));
        Self { shape: count, first: self.place(self.index(first)), step }
    }

    /// The cell that holds a place. Places are at most `beyond` nodes outside.
    fn cell(&self, place: DVec3, beyond: f64) -> Cell {
        Cell::new(self.shape, (place - self.first) / self.step, beyond)
    }
}

/// Weights of the values at -1, 0, 1 and 2 for a place between 0 and 1, or beyond.
fn cubic(t: f64) -> [f64; 4] {
    if !(0.0..=1.0).contains(&t) {
        // A straight line.
        return [0.0, 1.0 - t, t, 0.0];
    }
    [
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_and_weigh_the_nodes_around() {
        let nodes = Nodes { shape: [4, 3, 1], first: DVec3::new(1.0, 0.0, 5.0), step: DVec3::new(2.0, 1.0, 1.0) };
        let linear: Vec<DVec3> = (0..nodes.count()).map(|node| nodes.place(node)).collect();
        for place in [DVec3::new(2.2, 0.7, 5.0), DVec3::new(6.9, 1.9, 5.0)] {
            let mean: DVec3 = nodes.shares(place).iter().map(|(node, share)| *share * linear[*node]).sum();
            assert!((mean - place).length() < 1e-12 && (nodes.at(&linear, place) - place).length() < 1e-12);
        }
        let outside = nodes.shares(DVec3::new(-9.0, 9.0, 0.0));
        assert!((outside.iter().map(|(_, share)| share).sum::<f64>() - 1.0).abs() < 1e-12);
        let heaviest = outside.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert_eq!(heaviest, &(nodes.index([0, 2, 0]), 1.0));
        assert_eq!(nodes.steps(nodes.index([3, 1, 0])), [3, 1, 0]);
    }

    #[test]
    fn a_parabola_is_followed_between_nodes_and_a_line_beyond() {
        let nodes = Nodes { shape: [6, 5, 1], first: DVec3::ZERO, step: DVec3::new(1.0, 2.0, 1.0) };
        let field = |place: DVec3| DVec3::new(place.x * place.x, place.x - 3.0 * place.y, 1.0);
        let values: Vec<DVec3> = (0..nodes.count()).map(|node| field(nodes.place(node))).collect();
        let inside = DVec3::new(2.3, 4.9, 0.0);
        assert!((nodes.curved_at(&values, inside) - field(inside)).length() < 1e-12);
        assert!((nodes.at(&values, inside) - field(inside)).length() > 0.1);
        let outside = DVec3::new(-0.7, 9.5, 0.4);
        let found = nodes.curved_at(&values, outside);
        assert!((found.y - field(outside).y).abs() < 1e-12 && (found.z - 1.0).abs() < 1e-12, "{found:?}");
        // From the two nodes at the end: 0 and 1.
        assert!((found.x + 0.7).abs() < 1e-12, "{found:?}");
    }
}
