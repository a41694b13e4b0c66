//! A factor of the image of a rectangular cell.

/// A pixel's light along one axis, and its derivatives by m, alpha, the spot's size, the lattice's shift and the blur.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Factor {
    pub(super) light: f64,
    pub(super) by_m: f64,
    pub(super) by_alpha: f64,
    pub(super) by_size: f64,
    pub(super) by_shift: f64,
    /// By the blur, px.
    pub(super) by_blur: f64,
}

impl Factor {
    /// `a` of the one and `b` of the other.
    #[inline(always)]
    pub(super) fn mix(&self, a: f64, other: &Self, b: f64) -> Self {
        Self {
            light: a * self.light + b * other.light,
            by_m: a * self.by_m + b * other.by_m,
            by_alpha: a * self.by_alpha + b * other.by_alpha,
            by_size: a * self.by_size + b * other.by_size,
            by_shift: a * self.by_shift + b * other.by_shift,
            by_blur: a * self.by_blur + b * other.by_blur,
        }
    }
}
