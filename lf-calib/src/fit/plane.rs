//! Linear algebra in the plane.

use glam::{DMat2, DVec2};

/// The outer product a b'.
pub(crate) fn outer(a: DVec2, b: DVec2) -> DMat2 {
    DMat2::from_cols(a * b.x, a * b.y)
}

/// The middle of an image of shape (height, width), px from its left and top edge.
pub(crate) fn middle_px((height, width): (usize, usize)) -> DVec2 {
    0.5 * DVec2::new(width as f64, height as f64)
}
