//! Numbers of a pixel in a particle's image.

/// Numbers of a pixel: share of the particle's light; its derivatives by x, y, z and by the standard deviation of the
/// particle, all 1/mm; by the lattice's shift along the sensor's columns and rows, 1/mm; by the blur, 1/px.
pub const QUANTITIES: usize = 8;
/// The first of them: the share of light and its derivatives by place.
pub const PLACES: usize = 4;
/// The share of light alone.
pub(super) const LIGHT: usize = 1;
