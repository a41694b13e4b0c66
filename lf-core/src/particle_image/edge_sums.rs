//! Sums of a lenslet's factors along one axis, by the edges of its pixels.

/// A pixel's edge along one axis: the integral of H times the normal distribution up to the edge, and its derivatives.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Edge {
    /// The integral; its derivatives by the place on the array, plain and times the place in the stop, and by the size.
    pub(super) by_cell: [f64; 4],
    /// Its derivatives by the place of the edge in the stop, and by the blur.
    pub(super) by_kernel: [f64; 2],
}

impl Edge {
    #[inline(always)]
    pub(super) fn add(&mut self, cell: &[f64; 4], share: f64) {
        self.by_cell.iter_mut().zip(cell).for_each(|(sum, value)| *sum += share * value);
    }
}

/// Buffers of a thread.
#[derive(Debug, Default)]
pub(super) struct EdgeSums {
    pub(super) ends: Vec<f64>,
    pub(super) edges: Vec<Edge>,
    /// Sums that all edges beyond one share, by the first of them.
    pub(super) beyond: Vec<[f64; 4]>,
}
