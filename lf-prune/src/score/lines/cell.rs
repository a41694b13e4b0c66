//! The cell of a lenslet as a line of voxels crosses it.

use glam::DVec2;

/// Most left edges that a cell has: a hexagon's.
pub(super) const EDGES: usize = 3;

/// An edge that rises by less than this share of the cell's height counts as lying along the line.
const FLAT: f64 = 1e-4;

/// Tolerance across an edge, in voxels; rounding moves no voxel farther.
const ROUNDING: f64 = 1e-7;

/// An edge at the left of a cell.
pub(super) struct Edge {
    /// It cuts a line that passes `y` beyond the cell's centre at x = at + slope y.
    pub(super) at: f64,
    pub(super) slope: f64,
    /// Its ends along y.
    pub(super) low: f64,
    pub(super) high: f64,
    /// From the cell's centre to the centre of the cell on the edge's other side.
    pub(super) across: DVec2,
    /// Tolerance of a cut, voxels; closer than this, rounding decides.
    pub(super) tolerance: f64,
}

/// A convex cell about its centre, in voxels. It is symmetric under half a turn.
pub(super) struct Cell {
    /// Edges at its left that do not lie along the line.
    pub(super) left: Vec<Edge>,
    /// Half sides of the box around it.
    pub(super) reach: DVec2,
    /// A line closer to a corner than this, in voxels, may cut either edge: rounding decides.
    pub(super) tolerance: f64,
}

impl Cell {
    pub(super) fn new(corners: &[DVec2]) -> Self {
        let reach = corners.iter().fold(DVec2::ZERO, |reach, corner| reach.max(corner.abs()));
        let mut cell = Self { left: Vec::new(), reach, tolerance: ROUNDING };
        for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let way = to - from;
            if way.y.abs() < FLAT * reach.y {
                cell.tolerance = ROUNDING + way.y.abs();
                continue;
            }
            let slope = way.x / way.y;
            let at = from.x - from.y * slope;
            if at < 0.0 {
                let (low, high) = (from.y.min(to.y), from.y.max(to.y));
                let tolerance = ROUNDING * (1.0 + slope.abs());
                cell.left.push(Edge { at, slope, low, high, across: from + to, tolerance });
            }
        }
        // Farther than this from a corner, no voxel lies within the tolerance of both edges that meet there.
        for (n, one) in cell.left.iter().enumerate() {
            for other in &cell.left[..n] {
                let apart = (one.tolerance + other.tolerance) / (one.slope - other.slope).abs();
                cell.tolerance = cell.tolerance.max(ROUNDING + apart);
            }
        }
        cell
    }

    /// Where a line that passes `y` beyond the centre enters and leaves. The order is reversed if it misses the cell.
    pub(super) fn ends(&self, y: f64) -> (f64, f64) {
        let enter = |y: f64| self.left.iter().fold(f64::NEG_INFINITY, |x, edge| x.max(edge.at + edge.slope * y));
        if y.abs() > self.reach.y + self.tolerance {
            return (f64::INFINITY, f64::NEG_INFINITY);
        }
        (enter(y), -enter(-y))
    }
}
