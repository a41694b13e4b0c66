//! A particle of the fit.

/// A particle: its place and light. All particles have the model's size.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Spot {
    /// Centre, mm.
    pub place_mm: [f64; 3],
    /// Light that it sends through the stop, counts.
    pub light: f64,
}
