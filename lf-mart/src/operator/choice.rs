//! The one choice of how weights are applied and kept.

use super::voxels::{VoxelWeights, kept_bytes};
use super::{plane::Plane, profiles::ProfileWeights, stored};
use lf_core::Weights;
use lf_core::weights::{Path, RowSet};

/// Where weights are during the sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Storage {
    /// Profiles are kept; their products are made at every use.
    Profiles,
    /// The weights of all voxels are kept.
    Kept,
    /// Weights are made anew at every use, until those of the voxels still held fit.
    Remade,
    /// Weights are stored pixel by pixel, for the row action.
    ByPixel,
}

impl Storage {
    /// Foretells [`Operator::new`]: the storage, and the bytes of the weights from a sample of voxels and slices.
    pub(crate) fn choose(weights: &Weights, indices: &[u64], max_bytes: u64) -> (Self, u64) {
        if let Path::Aligned(aligned) = &weights.path {
            return (Self::Profiles, ProfileWeights::foretold_bytes(aligned, indices));
        }
        let count = stored::count_weights(weights, indices);
        let storage = if stored::fits(count, kept_bytes(max_bytes)) { Self::Kept } else { Self::Remade };
        (storage, VoxelWeights::foretold_bytes(weights, indices, count, max_bytes))
    }
}

/// The weights of a support's voxels.
pub(crate) enum Operator<'a> {
    /// For an aligned camera.
    Profiles(Box<ProfileWeights>),
    /// For any other.
    Voxels(VoxelWeights<'a>),
}

impl<'a> Operator<'a> {
    /// For `subsets` interleaved subsets of image rows. Weights are kept if they fit in a part of `max_bytes`.
    pub(crate) fn new(weights: &'a Weights, indices: &[u64], subsets: usize, max_bytes: u64) -> Self {
        match &weights.path {
            Path::Aligned(aligned) => Self::Profiles(Box::new(ProfileWeights::new(aligned, indices, subsets))),
            _ => Self::Voxels(VoxelWeights::new(weights, indices, subsets, kept_bytes(max_bytes))),
        }
    }

    pub(crate) fn retain(&mut self, held: &[bool]) {
        match self {
            Self::Profiles(weights) => weights.retain(held),
            Self::Voxels(weights) => weights.retain(held),
        }
    }

    /// Whether weights are made anew at every use.
    pub(crate) fn is_remade(&self) -> bool {
        matches!(self, Self::Voxels(weights) if weights.kept.is_none())
    }

    /// The number of weights that one projection or back-projection over all rows touches.
    pub(crate) fn weights(&self) -> u64 {
        match self {
            Self::Profiles(weights) => weights.weights(),
            Self::Voxels(weights) => weights.count,
        }
    }

    /// The sum of each voxel's weights.
    pub(crate) fn shares(&self) -> Vec<f32> {
        match self {
            Self::Profiles(weights) => weights.shares(),
            Self::Voxels(weights) => weights.shares(),
        }
    }

    /// Sets the subset's rows of `plane` to the projection of the strengths: p_i = sum_j w_ij E_j.
    pub(crate) fn project(&mut self, rows: RowSet, strengths: &[f32], plane: &mut Plane) {
        match self {
            Self::Profiles(weights) => weights.project(rows, strengths, plane),
            Self::Voxels(weights) => weights.project(rows, strengths, plane),
        }
    }

    /// Calls `update(j, strength, sum_i w_ij v_i, sum_i w_ij)` on every voxel's strength, with i over the subset's
    /// rows.
    pub(crate) fn back_project(
        &self,
        rows: RowSet,
        plane: &Plane,
        strengths: &mut [f32],
        update: impl Fn(usize, &mut f32, f32, f32) + Sync,
    ) {
        match self {
            Self::Profiles(weights) => weights.back_project(rows, plane, strengths, update),
            Self::Voxels(weights) => weights.back_project(rows, plane, strengths, update),
        }
    }
}
