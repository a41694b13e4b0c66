//! The mean of a cell over a pixel.

/// Mean of the cell's share over a pixel and the blur, with its derivatives by the place on the array and by the size
/// of the spot.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mean {
    pub(super) level: f64,
    pub(super) slope: [f64; 2],
    /// Second derivatives: xx, xy, yy.
    pub(super) curve: [f64; 3],
    pub(super) by_size: f64,
    /// Derivatives of slope and curvature by the size of the spot; 0 where they are not asked for.
    pub(super) slope_by_size: [f64; 2],
    pub(super) curve_by_size: [f64; 3],
}
