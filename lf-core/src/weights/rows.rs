//! Which rows of the image are wanted.

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

    /// Whether a row is one of them.
    #[inline]
    pub fn holds(self, row: u32) -> bool {
        row % self.step == self.first
    }

    /// For each of so many rows and the one behind the last, the first wanted from there on.
    pub(super) fn next_of(self, rows: usize) -> Vec<u32> {
        let behind = |row: u32| (self.first + self.step - row % self.step) % self.step;
        (0..=rows as u32).map(|row| row + behind(row)).collect()
    }
}
