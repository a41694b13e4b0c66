//! A function of a place on the array and of the spot's size.

/// A function that is read at a place along each axis.
pub(super) trait Table {
    /// A place along one axis, as the table reads it.
    type Taps: Copy;

    /// The taps of `x` along an axis, for a size that is `more` than the table's.
    fn taps(&self, axis: usize, x: f64, more: f64) -> Self::Taps;

    /// Whether the place lies before the first node.
    fn is_below(taps: &Self::Taps) -> bool;

    /// Value, slopes along x and y if N is more than 1, and derivative by the size if N is more than 4, for a size that
    /// is `more` than the table's.
    fn at<const N: usize>(&self, x: &Self::Taps, y: &Self::Taps, more: f64) -> [f64; 4];

    /// Bytes of the table.
    fn bytes(&self) -> usize;
}
