//! Nodes of a sum over a lenslet's cell: Gauss and Legendre's, in rows that end at the cell's sides.

use glam::DVec2;
use std::f64::consts::PI;

/// Nodes, in pitches from the cell's middle.
#[derive(Debug, Clone)]
pub(super) struct CellNodes {
    /// Rows of nodes, and the y of each.
    pub(super) y: Vec<f32>,
    /// Nodes of a row.
    pub(super) across: usize,
    /// Row by row: the x of each node, and its weight.
    pub(super) x: Vec<f32>,
    pub(super) weights: Vec<f32>,
    /// Whether all rows have the same x.
    pub(super) is_even: bool,
}

/// Corners whose y differ by less are one end of rows, pitches.
const ALIKE: f64 = 1e-6;
/// Nodes along y between two corners, beside their share of those over the whole cell.
const MORE: usize = 3;

impl CellNodes {
    /// For a convex cell, with this number of nodes along its width.
    pub(super) fn new(corners: &[DVec2], count: usize) -> Self {
        let mut ends: Vec<f64> = corners.iter().map(|corner| corner.y).collect();
        ends.sort_by(f64::total_cmp);
        ends.dedup_by(|a, b| (*a - *b).abs() < ALIKE);
        let height = ends[ends.len() - 1] - ends[0];
        let across = gauss(count);
        let (mut y, mut x, mut weights) = (vec![], vec![], vec![]);
        for band in ends.windows(2) {
            let share = (band[1] - band[0]) / height;
            let rows = if ends.len() == 2 { count } else { (count as f64 * share).ceil() as usize + MORE };
            for (place, weight) in gauss(rows) {
                let at = band[0] + (band[1] - band[0]) * place;
                let (left, right) = chord(corners, at);
                y.push(at as f32);
                x.extend(across.iter().map(|(place, _)| (left + (right - left) * place) as f32));
                let own = (band[1] - band[0]) * weight * (right - left);
                weights.extend(across.iter().map(|(_, share)| (own * share) as f32));
            }
        }
        let is_even = x.chunks(count).all(|row| row.iter().zip(&x).all(|(a, b)| (a - b).abs() < ALIKE as f32));
        Self { y, across: count, x, weights, is_even }
    }
}

/// Both ends of a convex cell's row.
fn chord(corners: &[DVec2], y: f64) -> (f64, f64) {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    for (n, from) in corners.iter().enumerate() {
        let to = corners[(n + 1) % corners.len()];
        if (from.y - y) * (to.y - y) < 0.0 {
            let x = from.x + (to.x - from.x) * (y - from.y) / (to.y - from.y);
            (left, right) = (left.min(x), right.max(x));
        }
    }
    (left, right)
}

/// Places between 0 and 1, and their weights.
fn gauss(count: usize) -> Vec<(f64, f64)> {
    let node = |k: usize| {
        // Newton's way to a zero of Legendre's polynomial.
        let mut x = (PI * (k as f64 + 0.75) / (count as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut before, mut level) = (1.0, x);
            for n in 1..count {
                let n = n as f64;
                (before, level) = (level, ((2.0 * n + 1.0) * x * level - n * before) / (n + 1.0));
            }
            slope = count as f64 * (x * level - before) / (x * x - 1.0);
            x -= level / slope;
        }
        (0.5 - 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polynomial over a square and a hexagon, by their moments.
    #[test]
    fn sums_are_integrals_over_the_cell() {
        let ring = |count: usize, radius: f64, turn: f64| -> Vec<DVec2> {
            (0..count).map(|n| radius * DVec2::from_angle(turn + n as f64 * 2.0 * PI / count as f64)).collect()
        };
        for (corners, area, second) in [
            (ring(4, 0.5f64.sqrt(), PI / 4.0), 1.0, 1.0 / 12.0),
            (ring(6, 3f64.sqrt() / 3.0, PI / 6.0), 0.75f64.sqrt(), 5.0 / 72.0 * 0.75f64.sqrt()),
            (ring(6, 3f64.sqrt() / 3.0, 0.7), 0.75f64.sqrt(), 5.0 / 72.0 * 0.75f64.sqrt()),
        ] {
            let nodes = CellNodes::new(&corners, 9);
            let sum = |f: fn(f64, f64) -> f64| -> f64 {
                let rows = nodes.y.iter().zip(nodes.x.chunks(nodes.across)).zip(nodes.weights.chunks(nodes.across));
                rows.map(|((y, x), weights)| {
                    let row = x.iter().zip(weights);
                    row.map(|(x, weight)| f64::from(*weight) * f(f64::from(*x), f64::from(*y))).sum::<f64>()
                })
                .sum()
            };
            assert!((sum(|_, _| 1.0) - area).abs() < 1e-5);
            assert!((sum(|x, _| x * x) - second).abs() < 1e-6 && (sum(|_, y| y * y) - second).abs() < 1e-6);
            assert!(sum(|x, y| x * y).abs() < 1e-6);
            assert_eq!(nodes.is_even, corners.len() == 4);
        }
    }
}
