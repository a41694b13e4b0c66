//! The key `microlenses` of a camera: a perfect lattice.

use serde::{Deserialize, Serialize};

/// How the lenslets are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Rows and columns one pitch apart.
    Square,
    /// Rows `pitch sqrt(3)/2` apart, odd rows shifted by half a pitch.
    Hexagonal,
}

/// The perfect lattice of the microlenses. Lenslet (i, j) has its centre at `offset_mm + R(rotation_rad) q`, where q is
/// `((i + 1/2) p, (j + 1/2) p)` for a square lattice and `((i + (j odd)/2) p, j p sqrt(3)/2)` for a hexagonal one; p is
/// the pitch, and R turns from x towards y. The lattice has no bounds: the sensor decides which lenslets are seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Microlenses {
    /// Square or hexagonal.
    pub layout: Layout,
    /// Distance p between neighbouring lenslets, mm.
    pub pitch_mm: f64,
    /// Focal length, mm; also the distance to the sensor if `gap_mm` is absent.
    pub focal_length_mm: f64,
    /// Rotation of the lattice about `offset_mm`, from x towards y, rad.
    pub rotation_rad: f64,
    /// Origin of the lattice on the array, mm from the optical axis.
    pub offset_mm: [f64; 2],
    /// Distance from the array to the sensor on the axis, mm; the focal length if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap_mm: Option<f64>,
}
