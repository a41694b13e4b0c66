//! The cell of a lenslet as a line of voxels crosses it.

use glam::DVec2;

/// Left edges that a cell has at most: a hexagon's.
pub(crate) const EDGES: usize = 3;

/// An edge that rises by less than this share of the cell's height counts as lying along the line.
const FLAT: f64 = 1e-4;

/// Share of a voxel, across an edge, that rounding moves no voxel by.
const ROUNDING: f64 = 1e-7;

/// An edge at the left of a cell.
#[derive(Debug, Clone)]
pub(crate) struct Edge {
    /// Where it cuts a line that passes `y` beyond the cell's centre: x = at + slope y.
    pub(crate) at: f64,
    pub(crate) slope: f64,
    /// Its ends along y.
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// From the cell's centre to that of the cell on its other side.
    pub(crate) across: DVec2,
    /// Voxels this near a cut are on the one side or on the other.
    pub(crate) unsure: f64,
}

/// A convex cell about its centre, in voxels; its own likeness turned by half a turn.
#[derive(Debug)]
pub(crate) struct Cell {
    /// Edges at its left that do not lie along the line.
    pub(crate) left: Vec<Edge>,
    /// Reach from the centre.
    pub(crate) reach: DVec2,
    /// Lines this near a corner may cut the edges on its one side or on its other.
    pub(crate) unsure: f64,
}

impl Cell {
    /// A cell by its corners in order.
    pub(crate) fn new(corners: &[DVec2]) -> Self {
        let reach = corners.iter().fold(DVec2::ZERO, |reach, corner| reach.max(corner.abs()));
        let mut cell = Self { left: Vec::new(), reach, unsure: ROUNDING };
        for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let way = to - from;
            if way.y.abs() < FLAT * reach.y {
                cell.unsure = ROUNDING + way.y.abs();
                continue;
            }
            let slope = way.x / way.y;
            let at = from.x - from.y * slope;
            if at < 0.0 {
                let (low, high) = (from.y.min(to.y), from.y.max(to.y));
                let unsure = ROUNDING * (1.0 + slope.abs());
                cell.left.push(Edge { at, slope, low, high, across: from + to, unsure });
            }
        }
        // Beyond that, no voxel is as near two edges that meet at a corner.
        for (n, one) in cell.left.iter().enumerate() {
            for other in &cell.left[..n] {
                let apart = (one.unsure + other.unsure) / (one.slope - other.slope).abs();
                cell.unsure = cell.unsure.max(ROUNDING + apart);
            }
        }
        cell
    }

    /// Where a line that passes `y` beyond the centre enters and leaves; the other way around where it misses.
    pub(crate) fn ends(&self, y: f64) -> (f64, f64) {
        let enter = |y: f64| self.left.iter().fold(f64::NEG_INFINITY, |x, edge| x.max(edge.at + edge.slope * y));
        if y.abs() > self.reach.y + self.unsure {
            return (f64::INFINITY, f64::NEG_INFINITY);
        }
        (enter(y), -enter(-y))
    }
}
