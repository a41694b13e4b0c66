//! The light of a sparse volume.

use lf_core::Grid;

/// Voxels that a volume holds: linear indices, strictly rising, and an intensity for each. All others are dark.
#[derive(Debug, Clone, Copy)]
pub struct VoxelLight<'a> {
    /// Grid of the voxels.
    pub grid: &'a Grid,
    /// Linear indices.
    pub indices: &'a [u64],
    /// Finite.
    pub intensity: &'a [f32],
}
