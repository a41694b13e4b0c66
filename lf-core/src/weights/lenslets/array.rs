//! The lenslets that the sensor sees, row by row.

use crate::lattice::Lattice;
use glam::DVec2;
use std::ops::RangeInclusive;

/// Centres of lenslets by their place in the lattice.
#[derive(Debug, Clone)]
pub(super) struct Array {
    first_row: i64,
    rows: Vec<Row>,
    centres_mm: Vec<DVec2>,
}

#[derive(Debug, Clone, Copy)]
struct Row {
    /// First lenslet of the row.
    first: i64,
    /// Place of the first lenslet in the list of centres.
    start: usize,
    count: usize,
}

impl Array {
    /// The lenslets with centres within a box of half sides `reach_mm` about the axis.
    pub(super) fn new(lattice: &Lattice, reach_mm: DVec2) -> Self {
        let mut array = Self { first_row: 0, rows: Vec::new(), centres_mm: Vec::new() };
        for (j, lenslets) in lattice.rows_within(DVec2::ZERO, reach_mm) {
            if array.rows.is_empty() {
                array.first_row = j;
            }
            let start = array.centres_mm.len();
            let row = Row { first: *lenslets.start(), start, count: lenslets.clone().count() };
            array.centres_mm.extend(lenslets.map(|i| lattice.centre_mm(i, j)));
            array.rows.push(row);
        }
        array
    }

    /// Centres of those lenslets of row `j` that the sensor sees, mm.
    #[inline(always)]
    pub(super) fn row_mm(&self, j: i64, lenslets: &RangeInclusive<i64>) -> &[DVec2] {
        let Some(row) = usize::try_from(j - self.first_row).ok().and_then(|n| self.rows.get(n)) else { return &[] };
        let first = (*lenslets.start() - row.first).clamp(0, row.count as i64);
        let end = (*lenslets.end() + 1 - row.first).clamp(first, row.count as i64);
        &self.centres_mm[row.start + first as usize..row.start + end as usize]
    }
}
