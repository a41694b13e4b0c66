//! Outlines of shapes and letters.

/// A piece of an outline, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Piece {
    Move([f32; 2]),
    Line([f32; 2]),
    Curve([[f32; 2]; 3]),
    Close,
}
