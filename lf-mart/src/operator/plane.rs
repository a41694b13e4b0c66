//! An image whose rows are padded for vectors.

/// Values at the end of a row of a plane, behind the image's columns: four lanes fit at any column.
pub(super) const PADDING: usize = 4;

/// An image whose rows are long enough for four-lane reads and writes at any column.
pub(crate) struct Plane {
    /// Values of a row.
    pub(crate) stride: usize,
    pub(crate) values: Vec<f32>,
}

impl Plane {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let stride = Self::stride(width);
        Self { stride, values: vec![0.0; stride * height] }
    }

    /// Values of a row for an image `width` pixels wide.
    pub(crate) fn stride(width: usize) -> usize {
        width + PADDING
    }
}
