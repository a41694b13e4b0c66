//! The one choice of how weights are applied and kept.

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
/// costs more than to clear them. Later a larger part pays, because one more sweep costs as much as keeping. Few are kept
/// at once.
const KEPT_PART: f64 = 0.2;
const KEPT_AT_FIRST: f64 = 0.125;
const KEPT_LATER: f64 = 0.4;
/// The same after coarse passes. One sweep later so few voxels are left.
const KEPT_CLEARED: f64 = 0.16;
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
    /// Foretells [`Operator::new`]: the storage, and the bytes of the weights from a sample of voxels and slices.
    /// `is_cleared` tells whether coarse passes come first.
    pub(crate) fn choose(
        weights: &Weights,
        indices: &[u64],
        (subsets, is_cleared): (usize, bool),
        max_bytes: u64,
    ) -> (Self, u64) {
        let bytes = Stored::foretold_bytes(weights, indices, subsets);
        let kept = |most_bytes| VoxelWeights::foretold_bytes(weights, indices.len(), bytes, most_bytes);
        let haze = match &weights.path {
            Path::Aligned(aligned) => (Self::Profiles, ProfileWeights::foretold_bytes(aligned, indices, subsets)),
            Path::Micro(micro) => (Self::Tables, MicroWeights::foretold_bytes(micro, subsets)),
            _ => {
                let most_bytes = kept_bytes(max_bytes);
                return (if Stored::fits(bytes, most_bytes) { Self::Kept } else { Self::Remade }, kept(most_bytes));
            }
        };
        let limits = Limits::new(weights, indices.len(), indices.len(), max_bytes);
        match limits.allow(indices.len(), bytes) {
            true => (Self::Kept, kept(bytes)),
            false => {
                let later = if is_cleared { KEPT_CLEARED } else { KEPT_LATER };
                let later = ((later * bytes as f64) as u64).max(bytes.min(FEW_BYTES));
                (haze.0, haze.1 + kept(limits.bytes.min(later)))
            }
        }
    }
}

/// When weights are kept.
#[derive(Clone, Copy)]
struct Limits {
    bytes: u64,
    /// In the first sweep, and later.
    voxels: [usize; 2],
    has_swept: bool,
}

impl Limits {
    fn new(weights: &Weights, voxels: usize, support: usize, max_bytes: u64) -> Self {
        let is_kept = match &weights.path {
            Path::Aligned(_) => weights.finds_runs(),
            Path::Micro(_) => true,
            _ => false,
        };
        if !is_kept {
            return Self::never();
        }
        let later = if voxels < support { KEPT_CLEARED } else { KEPT_LATER };
        let voxels = [(KEPT_AT_FIRST, voxels), (later, support)].map(|(part, all)| (part * all as f64) as usize);
        Self { bytes: (KEPT_PART * max_bytes as f64) as u64, voxels, has_swept: false }
    }

    /// Weights are not kept.
    fn never() -> Self {
        Self { bytes: 0, voxels: [0; 2], has_swept: false }
    }

    /// Whether weights of so many voxels, which take so many bytes, are kept.
    fn allow(&self, voxels: usize, bytes: u64) -> bool {
        let most = self.voxels[usize::from(self.has_swept)];
        Stored::fits(bytes, self.bytes) && (voxels <= most || bytes <= FEW_BYTES)
    }
}

/// The weights of a support's voxels.
pub(crate) enum Operator<'a> {
    /// For an aligned camera.
    Profiles(Box<ProfileWeights>, Haze<'a>),
    /// For any other camera: made micro-image by micro-image, until the weights of the voxels still held are kept.
    Micro(Box<MicroWeights<'a>>, Haze<'a>),
    /// Kept voxel by voxel, or made so for the paper's weights and spheres.
    Voxels(VoxelWeights<'a>),
}

/// All that is needed to keep the weights of the voxels that are left when the haze is gone.
pub(crate) struct Haze<'a> {
    weights: &'a Weights,
    indices: Vec<u64>,
    subsets: usize,
    limits: Limits,
}

impl<'a> Haze<'a> {
    /// Weights that are never kept.
    pub(crate) fn forever(weights: &'a Weights, subsets: usize) -> Self {
        Self { weights, indices: Vec::new(), subsets, limits: Limits::never() }
    }

    /// The weights of all voxels that are left, if they are to be kept.
    fn kept(&self) -> Option<VoxelWeights<'a>> {
        let Self { weights, indices, subsets, limits } = self;
        if limits.bytes == 0 {
            return None;
        }
        let bytes = Stored::foretold_bytes(weights, indices, *subsets);
        limits.allow(indices.len(), bytes).then(|| VoxelWeights::kept(weights, indices, *subsets, bytes))
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

/// Whether the weights of a part of `indices` are kept after so many sweeps, as [`Operator`] does it; `bytes` are those
/// of all.
pub(crate) fn are_kept(
    weights: &Weights,
    indices: &[u64],
    subsets: usize,
    max_bytes: u64,
) -> impl Fn(f64, usize) -> bool + use<> {
    let bytes = Stored::foretold_bytes(weights, indices, subsets) as f64;
    let mut limits = Limits::new(weights, indices.len(), indices.len(), max_bytes);
    if limits.bytes == 0 {
        // The weights of all that are left are kept as soon as they fit.
        limits = Limits { bytes: kept_bytes(max_bytes), voxels: [indices.len(); 2], has_swept: false };
    }
    let count = indices.len() as f64;
    move |part, sweeps| Limits { has_swept: sweeps > 0, ..limits }.allow((part * count) as usize, (part * bytes) as u64)
}

impl<'a> Operator<'a> {
    /// For `subsets` interleaved subsets of image rows. Weights are kept if they fit in a part of `max_bytes`.
    pub(crate) fn new(weights: &'a Weights, indices: &[u64], subsets: usize, max_bytes: u64, support: usize) -> Self {
        let limits = Limits::new(weights, indices.len(), support, max_bytes);
        let haze = Haze { weights, indices: indices.to_vec(), subsets, limits };
        match haze.kept() {
            Some(kept) => Self::Voxels(kept),
            None => Self::in_haze(haze, indices, kept_bytes(max_bytes)),
        }
    }

    /// Weights that are made at every use, until those of the voxels left are kept. Paths that keep them at once may take
    /// `most_bytes`.
    fn in_haze(haze: Haze<'a>, indices: &[u64], most_bytes: u64) -> Self {
        let Haze { weights, subsets, .. } = haze;
        match &weights.path {
            Path::Aligned(aligned) => Self::Profiles(Box::new(ProfileWeights::new(aligned, indices, subsets)), haze),
            Path::Micro(micro) => Self::Micro(Box::new(MicroWeights::new(micro, indices, subsets)), haze),
            _ => Self::Voxels(VoxelWeights::new(weights, indices, subsets, most_bytes)),
        }
    }

    /// Weights that are made at every use.
    pub(crate) fn remade(weights: &'a Weights, indices: &[u64], subsets: usize) -> Self {
        Self::in_haze(Haze::forever(weights, subsets), indices, 0)
    }

    /// Weights that are kept.
    pub(crate) fn kept(weights: &'a Weights, indices: &[u64], subsets: usize) -> Self {
        let bytes = Stored::foretold_bytes(weights, indices, subsets);
        Self::Voxels(VoxelWeights::kept(weights, indices, subsets, bytes))
    }

    pub(crate) fn retain(&mut self, held: &[bool]) {
        let kept = match self {
            Self::Micro(weights, haze) => {
                weights.retain(held);
                haze.retain(held)
            }
            Self::Profiles(weights, haze) => {
                weights.retain(held);
                haze.retain(held)
            }
            Self::Voxels(weights) => {
                weights.retain(held);
                None
            }
        };
        if let Some(kept) = kept {
            *self = Self::Voxels(kept);
        }
    }

    /// Ends a sweep. After the first, the weights of more voxels may be kept.
    pub(crate) fn end_sweep(&mut self) {
        let kept = match self {
            Self::Micro(_, haze) | Self::Profiles(_, haze) => haze.end_sweep(),
            Self::Voxels(_) => None,
        };
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
