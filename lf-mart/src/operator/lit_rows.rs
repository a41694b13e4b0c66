//! The image rows that a line of voxels lights.

use lf_core::weights::Chords;

/// An image row that a line of voxels lights.
#[derive(Debug, Clone, Copy)]
pub(super) struct LitRow {
    /// Place in a plane where the row begins.
    pub(super) start: usize,
    /// The row's share of the light.
    pub(super) share: f32,
    /// The cut by a round stop.
    pub(super) chords: Chords,
}

/// The image rows that a line of voxels lights.
#[derive(Debug, Default)]
pub(super) struct LitRows {
    rows: Vec<LitRow>,
    /// The largest start.
    last: usize,
}

impl LitRows {
    pub(super) fn clear(&mut self) {
        self.rows.clear();
        self.last = 0;
    }

    pub(super) fn push(&mut self, row: LitRow) {
        self.last = self.last.max(row.start);
        self.rows.push(row);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    pub(super) fn as_slice(&self) -> &[LitRow] {
        &self.rows
    }

    /// The largest start of a row in the plane.
    pub(super) fn last(&self) -> usize {
        self.last
    }
}
