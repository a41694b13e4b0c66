//! In: weights and voxels. Out: projection and back-projection over a subset of the image's rows.
//! First file to open: `choice.rs`; then `profiles.rs` for aligned cameras or `voxels.rs` for all others.

mod choice;
mod kernel;
#[cfg(target_arch = "x86_64")]
mod kernel_avx2;
mod kernel_portable;
mod micro;
mod plane;
mod profile_sums;
mod profiles;
mod row_buffer;
mod stencils;
mod stored;
mod voxels;

#[cfg(test)]
pub(crate) use choice::DensePhase;
pub(crate) use choice::{Operator, Storage};
#[cfg(test)]
pub(crate) use micro::MicroWeights;
pub(crate) use plane::{Plane, keep};
#[cfg(test)]
pub(crate) use profiles::ProfileWeights;
pub(crate) use stored::count_weights;
pub(crate) use voxels::BLOCKS;
#[cfg(test)]
pub(crate) use voxels::VoxelWeights;
