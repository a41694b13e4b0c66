//! Chooses how weights are applied and when they are kept.

use super::voxels::{VoxelWeights, kept_bytes};
use super::{
    micro::MicroWeights,
    plane::{Plane, keep},
    profiles::ProfileWeights,
    stored::Stored,
};
use lf_core::Weights;
use lf_core::weights::{Path, RowSet};

/// Exact weights are kept once they take no more than this part of the memory allowed, and no more than a part of the
/// support's voxels is left. In the first sweep this part is small, because most voxels soon go: making their weights
/// costs more than to drop the dark ones. Later a larger part pays, because one more sweep costs as much as keeping.
/// Few are kept at once.
const KEPT_PART: f64 = 0.2;
const KEPT_AT_FIRST: f64 = 0.125;
const KEPT_LATER: f64 = 0.4;
const FEW_BYTES: u64 = 1 << 25;

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
    /// Predicts the storage that [`Operator::new`] will choose and its bytes, estimated from sampled voxels and slices.
    pub(crate) fn choose(weights: &Weights, indices: &[u64], subsets: usize, max_bytes: u64) -> (Self, u64) {
        let bytes = Stored::estimated_bytes(weights, indices, subsets);
        let kept = |most_bytes| VoxelWeights::estimated_bytes(weights, indices.len(), bytes, most_bytes);
        let (storage, dense_bytes) = match &weights.path {
            Path::Aligned(aligned) => (Self::Profiles, ProfileWeights::estimated_bytes(aligned, indices, subsets)),
            Path::Micro(micro) => (Self::Tables, MicroWeights::estimated_bytes(micro, subsets)),
            _ => {
                let most_bytes = kept_bytes(max_bytes);
                return (if Stored::fits(bytes, most_bytes) { Self::Kept } else { Self::Remade }, kept(most_bytes));
            }
        };
        let limits = Limits::new(weights, indices.len(), max_bytes);
        if limits.allow(indices.len(), bytes) {
            return (Self::Kept, kept(bytes));
        }
        let later = ((KEPT_LATER * bytes as f64) as u64).max(bytes.min(FEW_BYTES));
        (storage, dense_bytes + kept(limits.bytes.min(later)))
    }
}

/// When weights are kept.
struct Limits {
    bytes: u64,
    /// Voxels whose weights are kept in the first sweep, and later.
    voxels: [usize; 2],
    has_swept: bool,
}

impl Limits {
    fn new(weights: &Weights, voxels: usize, max_bytes: u64) -> Self {
        let is_kept = match &weights.path {
            Path::Aligned(_) => weights.finds_runs(),
            Path::Micro(_) => true,
            _ => false,
        };
        if !is_kept {
            return Self::never();
        }
        let voxels = [KEPT_AT_FIRST, KEPT_LATER].map(|part| (part * voxels as f64) as usize);
        Self { bytes: (KEPT_PART * max_bytes as f64) as u64, voxels, has_swept: false }
    }

    /// Weights are not kept.
    fn never() -> Self {
        Self { bytes: 0, voxels: [0; 2], has_swept: false }
    }

    /// Whether the weights of `voxels` voxels, which take `bytes`, are kept.
    fn allow(&self, voxels: usize, bytes: u64) -> bool {
        let most = self.voxels[usize::from(self.has_swept)];
        Stored::fits(bytes, self.bytes) && (voxels <= most || bytes <= FEW_BYTES)
    }
}

/// The weights of a support's voxels.
pub(crate) enum Operator<'a> {
    /// For an aligned camera.
    Profiles(Box<ProfileWeights>, DensePhase<'a>),
    /// For any other camera: made micro-image by micro-image, until the weights of the voxels still held are kept.
    Micro(Box<MicroWeights<'a>>, DensePhase<'a>),
    /// Kept voxel by voxel, or made so for the paper's weights and spheres.
    Voxels(VoxelWeights<'a>),
}

/// Inputs for storing weights once the first sweeps have dropped the dark voxels.
pub(crate) struct DensePhase<'a> {
    weights: &'a Weights,
    indices: Vec<u64>,
    subsets: usize,
    limits: Limits,
}

impl<'a> DensePhase<'a> {
    /// Weights that are never kept.
    #[cfg(test)]
    pub(crate) fn forever(weights: &'a Weights, subsets: usize) -> Self {
        Self { weights, indices: Vec::new(), subsets, limits: Limits::never() }
    }

    /// The weights of all voxels that are left, if they are to be kept.
    fn kept(&self) -> Option<VoxelWeights<'a>> {
        let Self { weights, indices, subsets, limits } = self;
        if limits.bytes == 0 {
            return None;
        }
        let bytes = Stored::estimated_bytes(weights, indices, *subsets);
        limits.allow(indices.len(), bytes).then(|| VoxelWeights::new(weights, indices, *subsets, u64::MAX))
    }

    /// Ends a sweep, and returns the weights of all voxels that are left if they are to be kept now.
    fn end_sweep(&mut self) -> Option<VoxelWeights<'a>> {
        if self.limits.has_swept {
            return None;
        }
        self.limits.has_swept = true;
        self.kept()
    }

    /// Drops voxels, and returns the weights of those left if they are to be kept now.
    fn retain(&mut self, held: &[bool]) -> Option<VoxelWeights<'a>> {
        keep(&mut self.indices, held);
        self.kept()
    }
}

impl<'a> Operator<'a> {
    /// For `subsets` interleaved subsets of image rows. Weights are kept if they fit in a part of `max_bytes`.
    pub(crate) fn new(weights: &'a Weights, indices: &[u64], subsets: usize, max_bytes: u64) -> Self {
        let limits = Limits::new(weights, indices.len(), max_bytes);
        let dense = DensePhase { weights, indices: indices.to_vec(), subsets, limits };
        match dense.kept() {
            Some(kept) => Self::Voxels(kept),
            None => Self::in_dense_phase(dense, indices, kept_bytes(max_bytes)),
        }
    }

    /// Weights that are made at every use, until those of the voxels left are kept. Paths that keep them at once may
    /// take `most_bytes`.
    fn in_dense_phase(dense: DensePhase<'a>, indices: &[u64], most_bytes: u64) -> Self {
        let DensePhase { weights, subsets, .. } = dense;
        match &weights.path {
            Path::Aligned(aligned) => Self::Profiles(Box::new(ProfileWeights::new(aligned, indices, subsets)), dense),
            Path::Micro(micro) => Self::Micro(Box::new(MicroWeights::new(micro, indices, subsets)), dense),
            _ => Self::Voxels(VoxelWeights::new(weights, indices, subsets, most_bytes)),
        }
    }

    pub(crate) fn retain(&mut self, held: &[bool]) {
        let kept = match self {
            Self::Micro(weights, dense) => {
                weights.retain(held);
                dense.retain(held)
            }
            Self::Profiles(weights, dense) => {
                weights.retain(held);
                dense.retain(held)
            }
            Self::Voxels(weights) => {
                weights.retain(held);
                None
            }
        };
        self.switch_to(kept);
    }

    /// Ends a sweep. After the first, the weights of more voxels may be kept.
    pub(crate) fn end_sweep(&mut self) {
        let kept = match self {
            Self::Micro(_, dense) | Self::Profiles(_, dense) => dense.end_sweep(),
            Self::Voxels(_) => None,
        };
        self.switch_to(kept);
    }

    fn switch_to(&mut self, kept: Option<VoxelWeights<'a>>) {
        if let Some(kept) = kept {
            *self = Self::Voxels(kept);
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
            Self::Profiles(weights, _) => weights.weights(),
            Self::Voxels(weights) => weights.count,
        }
    }

    /// The sum of each voxel's weights.
    pub(crate) fn shares(&self) -> Vec<f32> {
        match self {
            Self::Micro(weights, _) => weights.shares(),
            Self::Profiles(weights, _) => weights.shares(),
            Self::Voxels(weights) => weights.shares(),
        }
    }

    /// Sets the subset's rows of `plane` to the projection of the strengths: p_i = sum_j w_ij E_j.
    pub(crate) fn project(&mut self, rows: RowSet, strengths: &[f32], plane: &mut Plane) {
        match self {
            Self::Micro(weights, _) => weights.project(rows, strengths, plane),
            Self::Profiles(weights, _) => weights.project(rows, strengths, plane),
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
            Self::Profiles(weights, _) => weights.back_project(rows, plane, strengths, update),
            Self::Voxels(weights) => weights.back_project(rows, plane, strengths, update),
        }
    }
}
