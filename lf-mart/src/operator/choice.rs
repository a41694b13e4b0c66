//! The one choice of how weights are applied and kept.

use super::voxels::{VoxelWeights, kept_bytes};
use super::{
    micro::MicroWeights,
    plane::{Plane, keep},
    profiles::ProfileWeights,
    stored,
};
use lf_core::Weights;
use lf_core::weights::{Path, RowSet};

/// Exact weights are kept once they take no more than this part of the memory allowed, and made from tables before. Kept
/// weights are ten times as fast and a little more exact, but a camera of many pixels has weights of many GB.
const KEPT_PART: f64 = 0.2;

fn haze_bytes(max_bytes: u64) -> u64 {
    (KEPT_PART * max_bytes as f64) as u64
}

/// Where weights are during the sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Storage {
    /// Profiles are kept; their products are made at every use.
    Profiles,
    /// Weights are made from tables at every use, until those of the voxels still held fit.
    Tables,
    /// The weights of all voxels are kept.
    Kept,
    /// Weights are made anew at every use, until those of the voxels still held fit.
    Remade,
    /// Weights are stored pixel by pixel, for the row action.
    ByPixel,
}

impl Storage {
    /// Foretells [`Operator::new`]: the storage, and the bytes of the weights from a sample of voxels and slices.
    pub(crate) fn choose(weights: &Weights, indices: &[u64], subsets: usize, max_bytes: u64) -> (Self, u64) {
        if let Path::Aligned(aligned) = &weights.path {
            return (Self::Profiles, ProfileWeights::foretold_bytes(aligned, indices, subsets));
        }
        if let Path::Micro(micro) = &weights.path {
            let most_bytes = haze_bytes(max_bytes);
            let count = stored::count_weights(weights, indices);
            let kept = VoxelWeights::foretold_bytes(weights, indices, count, most_bytes);
            if stored::fits(count, most_bytes) {
                return (Self::Kept, kept);
            }
            return (Self::Tables, MicroWeights::foretold_bytes(micro, subsets) + kept);
        }
        let count = stored::count_weights(weights, indices);
        let storage = if stored::fits(count, kept_bytes(max_bytes)) { Self::Kept } else { Self::Remade };
        (storage, VoxelWeights::foretold_bytes(weights, indices, count, kept_bytes(max_bytes)))
    }
}

/// The weights of a support's voxels.
pub(crate) enum Operator<'a> {
    /// For an aligned camera.
    Profiles(Box<ProfileWeights>),
    /// For exact weights, until those of the voxels still held fit into memory.
    Micro(Box<MicroWeights<'a>>, Haze<'a>),
    /// For any other.
    Voxels(VoxelWeights<'a>),
}

/// All that is needed to keep the weights of the voxels that are left when the haze is gone.
pub(crate) struct Haze<'a> {
    weights: &'a Weights,
    indices: Vec<u64>,
    subsets: usize,
    most_bytes: u64,
}

impl<'a> Haze<'a> {
    /// Weights that are never kept.
    #[cfg(test)]
    pub(crate) fn forever(weights: &'a Weights, subsets: usize) -> Self {
        Self { weights, indices: Vec::new(), subsets, most_bytes: 0 }
    }

    /// The weights of all voxels that are left, if they fit.
    fn kept(&self) -> Option<VoxelWeights<'a>> {
        let Self { weights, indices, subsets, most_bytes } = self;
        let count = stored::count_weights(weights, indices);
        stored::fits(count, *most_bytes).then(|| VoxelWeights::new(weights, indices, *subsets, *most_bytes))
    }
}

impl<'a> Operator<'a> {
    /// For `subsets` interleaved subsets of image rows. Weights are kept if they fit in a part of `max_bytes`.
    pub(crate) fn new(weights: &'a Weights, indices: &[u64], subsets: usize, max_bytes: u64) -> Self {
        match &weights.path {
            Path::Aligned(aligned) => Self::Profiles(Box::new(ProfileWeights::new(aligned, indices, subsets))),
            Path::Micro(micro) => {
                let haze = Haze { weights, indices: indices.to_vec(), subsets, most_bytes: haze_bytes(max_bytes) };
                match haze.kept() {
                    Some(kept) => Self::Voxels(kept),
                    None => Self::Micro(Box::new(MicroWeights::new(micro, indices, subsets)), haze),
                }
            }
            _ => Self::Voxels(VoxelWeights::new(weights, indices, subsets, kept_bytes(max_bytes))),
        }
    }

    pub(crate) fn retain(&mut self, held: &[bool]) {
        match self {
            Self::Micro(weights, haze) => {
                weights.retain(held);
                keep(&mut haze.indices, held);
                if let Some(kept) = haze.kept() {
                    *self = Self::Voxels(kept);
                }
            }
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
            Self::Micro(weights, _) => weights.weights(),
            Self::Profiles(weights) => weights.weights(),
            Self::Voxels(weights) => weights.count,
        }
    }

    /// The sum of each voxel's weights.
    pub(crate) fn shares(&self) -> Vec<f32> {
        match self {
            Self::Micro(weights, _) => weights.shares(),
            Self::Profiles(weights) => weights.shares(),
            Self::Voxels(weights) => weights.shares(),
        }
    }

    /// Sets the subset's rows of `plane` to the projection of the strengths: p_i = sum_j w_ij E_j.
    pub(crate) fn project(&mut self, rows: RowSet, strengths: &[f32], plane: &mut Plane) {
        match self {
            Self::Micro(weights, _) => weights.project(rows, strengths, plane),
            Self::Profiles(weights) => weights.project(rows, strengths, plane),
            Self::Voxels(weights) => weights.project(rows, strengths, plane),
        }
    }

    /// Calls `update(j, strength, sum_i w_ij v_i, sum_i w_ij)` on every voxel's strength, with i over the subset's
    /// rows.
    pub(crate) fn back_project(
        &mut self,
        rows: RowSet,
        plane: &Plane,
        strengths: &mut [f32],
        update: impl Fn(usize, &mut f32, f32, f32) + Sync,
    ) {
        match self {
            Self::Micro(weights, _) => weights.back_project(rows, plane, strengths, update),
            Self::Profiles(weights) => weights.back_project(rows, plane, strengths, update),
            Self::Voxels(weights) => weights.back_project(rows, plane, strengths, update),
        }
    }
}
