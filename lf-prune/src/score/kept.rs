//! The voxels kept in a slice.

/// Voxels of a slice as (x + nx y, score), rising.
pub(super) type Kept = Vec<(u32, f32)>;
