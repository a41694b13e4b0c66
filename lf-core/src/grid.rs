//! The voxel grid: from linear index to voxel coordinates to millimetres, and back.

use crate::Refusal;
use serde::{Deserialize, Serialize};
use std::{fmt, ops::Range};

/// A regular grid of voxels in the object frame of [`crate::optics`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Voxels along x, y, z.
    pub shape: [usize; 3],
    /// Distance between voxel centres along x, y, z, mm.
    pub spacing_mm: [f64; 3],
    /// Centre of voxel (0, 0, 0), mm.
    pub origin_mm: [f64; 3],
}

/// Grids agree if spacings differ by less than this fraction of the spacing, and origins by less than this fraction of
/// the extent: far above rounding, far below a shift that matters.
const TOLERANCE: f64 = 1e-9;

impl fmt::Display for Grid {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [nx, ny, nz] = self.shape;
        let ([dx, dy, dz], [x, y, z]) = (self.spacing_mm.map(short), self.origin_mm.map(short));
        write!(f, "grid of {nx} x {ny} x {nz} voxels of {dx} x {dy} x {dz} mm from ({x}, {y}, {z}) mm")
    }
}

/// A length for messages, without rounding errors below 1e-9 mm.
fn short(length_mm: f64) -> f64 {
    (length_mm * 1e9).round() / 1e9 + 0.0
}

impl Grid {
    /// Whether two grids are equal within rounding.
    pub fn agrees_with(&self, other: &Self) -> bool {
        self.shape == other.shape
            && (0..3).all(|axis| {
                let spacing = self.spacing_mm[axis].max(other.spacing_mm[axis]);
                let extent = spacing * self.shape[axis] as f64;
                (self.spacing_mm[axis] - other.spacing_mm[axis]).abs() <= TOLERANCE * spacing
                    && (self.origin_mm[axis] - other.origin_mm[axis]).abs() <= TOLERANCE * extent
            })
    }

    /// A grid centred in `bounds_mm`, the ends of each axis: `round(extent / spacing)` voxels along x and y, and along
    /// z as many as cover the depth. Voxels are deep, and particles that lie beside them are lost.
    pub fn in_bounds(bounds_mm: [[f64; 2]; 3], spacing_mm: [f64; 3]) -> Result<Self, Refusal> {
        let mut shape = [0; 3];
        let mut origin_mm = [0.0; 3];
        for axis in 0..3 {
            let [low, high] = bounds_mm[axis];
            let voxels = (high - low) / spacing_mm[axis];
            let count = if axis == 2 { (voxels - TOLERANCE * voxels).ceil() } else { voxels.round() };
            let holds_voxels = count >= 1.0 && count < 2f64.powi(40) && spacing_mm[axis] > 0.0;
            let (name, [from, to, step]) = (["x", "y", "z"][axis], [low, high, spacing_mm[axis]].map(short));
            let found = || format!("{name} from {from} to {to} mm in steps of {step} mm holds no voxel");
            Refusal::unless(holds_voxels, found, "wanted bounds that hold a voxel")?;
            shape[axis] = count as usize;
            origin_mm[axis] = 0.5 * (low + high) - 0.5 * (count - 1.0) * spacing_mm[axis];
        }
        let grid = Self { shape, spacing_mm, origin_mm };
        grid.check().map(|()| grid)
    }

    /// Checks that the grid has at most 2^62 voxels and a place in space.
    pub fn check(&self) -> Result<(), Refusal> {
        let Self { shape, spacing_mm, origin_mm } = self;
        let count = shape.iter().try_fold(1u64, |product, &n| product.checked_mul(n as u64));
        let is_countable = count.is_some_and(|count| (1..=1 << 62).contains(&count));
        Refusal::unless(is_countable, || format!("grid shape {shape:?}"), "wanted 1 to 2^62 voxels")?;
        let positive = spacing_mm.iter().all(|spacing| spacing.is_finite() && *spacing > 0.0);
        Refusal::unless(positive, || format!("grid spacing_mm {spacing_mm:?}"), "wanted positive lengths")?;
        let finite = origin_mm.iter().all(|origin| origin.is_finite());
        Refusal::unless(finite, || format!("grid origin_mm {origin_mm:?}"), "wanted finite lengths")
    }

    /// Number of voxels.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> u64 {
        self.shape.iter().map(|&n| n as u64).product()
    }

    /// Linear index `x + nx (y + ny z)`.
    #[inline]
    pub fn index(&self, voxel: [usize; 3]) -> u64 {
        let [nx, ny, _] = self.shape.map(|n| n as u64);
        voxel[0] as u64 + nx * (voxel[1] as u64 + ny * voxel[2] as u64)
    }

    /// Voxel coordinates of a linear index.
    #[inline]
    pub fn voxel(&self, index: u64) -> [usize; 3] {
        let [nx, ny, _] = self.shape.map(|n| n as u64);
        [(index % nx) as usize, (index / nx % ny) as usize, (index / nx / ny) as usize]
    }

    /// Coordinate of voxel `i`'s centre along `axis`, mm.
    #[inline]
    pub fn centre_mm(&self, axis: usize, i: usize) -> f64 {
        self.origin_mm[axis] + i as f64 * self.spacing_mm[axis]
    }

    /// The voxels along each axis that have their centres in a box of x0, x1, y0, y1, z0, z1 mm.
    pub fn voxels_within(&self, box_mm: [f64; 6]) -> [Range<usize>; 3] {
        /// Tolerance for rounding: millimetres are rarely whole in binary.
        const TOLERANCE_VOX: f64 = 1e-6;
        [0, 1, 2].map(|axis| {
            let clamp = |voxel: f64| voxel.clamp(0.0, self.shape[axis] as f64) as usize;
            let [low, high] = [0, 1].map(|side| self.place_vox(axis, box_mm[2 * axis + side]));
            clamp((low - TOLERANCE_VOX).ceil())..clamp((high + TOLERANCE_VOX).floor() + 1.0)
        })
    }

    /// Voxel coordinate of a point along `axis`; a whole number is a voxel centre.
    #[inline]
    pub fn place_vox(&self, axis: usize, mm: f64) -> f64 {
        (mm - self.origin_mm[axis]) / self.spacing_mm[axis]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_is_centred_in_its_bounds_and_covers_the_depth() {
        let grid = Grid::in_bounds([[-1.0, 1.0], [0.0, 1.04], [-5.0, 6.0]], [0.5, 0.25, 10.0]).unwrap();
        assert_eq!(grid.shape, [4, 4, 2]);
        assert_eq!(grid.origin_mm, [-0.75, 0.52 - 0.375, -4.5]);
        for index in 0..grid.len() {
            assert_eq!(grid.index(grid.voxel(index)), index);
        }
        assert!((grid.place_vox(0, grid.centre_mm(0, 3)) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_box_holds_the_voxels_with_their_centres_in_it() {
        let grid = Grid { shape: [10, 10, 4], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0; 3] };
        // 0.1 * 3 is not 0.3 in binary.
        assert_eq!(grid.voxels_within([0.3, 0.7, -5.0, 5.0, 2.5, 2.9]), [3..8, 0..10, 3..3]);
    }

    #[test]
    fn unusable_grids_are_refused() {
        assert!(Grid::in_bounds([[0.0, 0.0], [0.0, 1.0], [0.0, 1.0]], [0.5; 3]).is_err());
        assert!(Grid::in_bounds([[0.0, 1.0], [0.0, f64::NAN], [0.0, 1.0]], [0.5; 3]).is_err());
        let grid = Grid { shape: [usize::MAX, 2, 2], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        assert!(grid.check().is_err());
    }
}
