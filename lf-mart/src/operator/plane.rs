//! Values of pixels and values of voxels, as the sweeps hold them.

/// Values at the end of a row of a plane, behind the image's columns.
pub(super) const PADDING: usize = 4;

/// An image whose rows are long enough to read and write four values at any column.
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

    pub(crate) fn stride(width: usize) -> usize {
        width + PADDING
    }
}

/// Keeps the values of the voxels that are held.
pub(crate) fn keep<T>(values: &mut Vec<T>, held: &[bool]) {
    let mut held = held.iter();
    values.retain(|_| *held.next().expect("one for each"));
}
