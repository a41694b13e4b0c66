//! The part of the volume that is correlated.

use crate::error::{Refused, Side};
use lf_core::Grid;
use std::ops::Range;

/// The part of the volume that is correlated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Mask<'a> {
    /// The whole volume.
    Everything,
    /// A box of voxels. Windows lie inside it.
    Box([Range<usize>; 3]),
    /// A set of voxels as strictly rising linear indices of the grid, for example a support. Light elsewhere is
    /// ignored.
    Support(&'a [u64]),
}

impl Mask<'_> {
    /// The voxels that windows may hold, in a volume of `shape`.
    pub(crate) fn sides(&self, shape: [usize; 3]) -> [Range<usize>; 3] {
        match self {
            Self::Box(sides) => std::array::from_fn(|axis| {
                let end = sides[axis].end.min(shape[axis]);
                sides[axis].start.min(end)..end
            }),
            _ => shape.map(|n| 0..n),
        }
    }

    /// The grid of the voxels that windows may hold. Refuses a box that holds no voxel of the volume.
    pub fn part(&self, grid: &Grid) -> Result<Grid, Refused> {
        let sides = self.sides(grid.shape);
        if sides.iter().any(Range::is_empty) {
            let found = format!("a box that holds no voxel of a {grid}");
            return Err(Refused::new(Side::Mask, found, "wanted a box that holds some of the volume"));
        }
        Ok(Grid {
            shape: sides.each_ref().map(Range::len),
            spacing_mm: grid.spacing_mm,
            origin_mm: std::array::from_fn(|a| grid.origin_mm[a] + sides[a].start as f64 * grid.spacing_mm[a]),
        })
    }

    pub(crate) fn holds(&self, index: u64, voxel: [usize; 3]) -> bool {
        match self {
            Self::Everything => true,
            Self::Box(sides) => (0..3).all(|axis| sides[axis].contains(&voxel[axis])),
            Self::Support(indices) => indices.binary_search(&index).is_ok(),
        }
    }

    /// Whether the light of a voxel of the part counts; `shape` is the part's.
    pub(crate) fn holds_in_part(&self, [x, y, z]: [usize; 3], shape: [usize; 3]) -> bool {
        match self {
            Self::Support(indices) => indices.binary_search(&((x + shape[0] * (y + shape[1] * z)) as u64)).is_ok(),
            _ => true,
        }
    }

    /// The mask without a support. Volumes keep the light outside the support until they are deformed, because it may
    /// move inside.
    pub(crate) fn without_support(&self) -> Self {
        match self {
            Self::Support(_) => Self::Everything,
            other => other.clone(),
        }
    }
}
