//! The image rows that a computation asks for.

/// Every `step`-th image row from `first` on; `step` is 1 or more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowSet {
    /// The first row, less than `step`.
    pub first: u32,
    /// Rows to the next.
    pub step: u32,
}

impl RowSet {
    /// All rows.
    pub const ALL: Self = Self { first: 0, step: 1 };

    /// Whether a row is in the set.
    #[inline]
    pub fn holds(self, row: u32) -> bool {
        row % self.step == self.first
    }

    /// For each row of an image of `rows` rows, and for the end, the first row of the set at or after it.
    pub(super) fn next_from(self, rows: usize) -> Vec<u32> {
        let ahead = |row: u32| (self.first + self.step - row % self.step) % self.step;
        (0..=rows as u32).map(|row| row + ahead(row)).collect()
    }
}
