//! Positive numbers at the nodes of a grid, and between them.

use crate::vectors::Nodes;
use glam::DVec3;

/// Sets of N positive numbers at nodes, as natural logarithms.
pub(crate) struct LogField<const N: usize> {
    pub nodes: Nodes,
    pub logs: Vec<[f64; N]>,
}

impl<const N: usize> LogField<N> {
    /// The numbers at a place: linear between nodes in the logarithm.
    pub fn at(&self, place: DVec3) -> [f64; N] {
        let mut sums = [0.0; N];
        for (node, share) in self.nodes.shares(place) {
            sums.iter_mut().zip(&self.logs[node]).for_each(|(sum, log)| *sum += share * log);
        }
        sums.map(f64::exp)
    }
}
