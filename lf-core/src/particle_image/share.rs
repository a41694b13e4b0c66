//! Edges and factors that the lenslets of a row, and those of a column, have in common.

use super::axis::Axis;
use super::factor::Factor;
use super::place::Place;

/// A lenslet along one axis: the pixels that it lights, and the factors of their light. On a lattice in line with the
/// pixels all lenslets of a column, or of a row, have the same.
#[derive(Debug, Default)]
pub(super) struct Share {
    pub(super) axis: Option<Axis>,
    pub(super) by_points: bool,
    /// First and end pixel; none if both are equal.
    pub(super) first: i64,
    pub(super) end: i64,
    pub(super) edges: Vec<Place>,
    pub(super) factors: Vec<Factor>,
}

/// The shares of the row in hand and of the columns that it has in common with the last one.
#[derive(Debug, Default)]
pub(super) struct Shared {
    pub(super) row: Share,
    pub(super) columns: Vec<Share>,
    /// The next column.
    pub(super) next: usize,
}

impl Shared {
    /// Forgets the shares of another particle.
    pub(super) fn begin(&mut self) {
        self.row.axis = None;
        self.columns.iter_mut().for_each(|column| column.axis = None);
        self.next = 0;
    }
}
