//! The numbers that are printed about the quality of a volume.

use super::sums::QualitySums;
use serde::Serialize;

/// The score of a reconstructed volume, E1, against the truth, E0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// Q. 0 if either volume has no light.
    pub q: f64,
    /// sum E1 E0 / sum E1^2: the factor on the volume that brings it closest to the truth in least squares. A share of
    /// 1 - q^2 of the truth's energy is then left over. None, `null` in JSON, if the volume has no light.
    pub scale: Option<f64>,
    /// Share of sum |E1| in voxels where E0 is zero. It depends on where the truth ends the image of a particle. None
    /// if the volume has no light.
    pub ghost_share: Option<f64>,
    /// Share of sum |E0| in voxels where E1 is zero. None if the truth has no light.
    pub missed_share: Option<f64>,
    /// Largest |E1 - E0| of a voxel over the largest |E0|. None if the truth has no light.
    pub max_difference: Option<f64>,
    /// Voxels of the truth that are not zero.
    pub truth_voxels: u64,
    /// Voxels of the volume that are not zero.
    pub volume_voxels: u64,
    /// Voxels that are zero in neither.
    pub shared_voxels: u64,
    /// sum E0.
    pub truth_sum: f64,
    /// sum E1.
    pub volume_sum: f64,
    /// Scores of the slices across z.
    pub by_depth: QualityByDepth,
    /// Scores of boxes.
    pub by_region: QualityByRegion,
}

/// Scores of every slice of the grid, in the order of z.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QualityByDepth {
    /// Centres of the slices, mm.
    pub z_mm: Vec<f64>,
    /// One score for each slice.
    #[serde(flatten)]
    pub scores: PartScores,
}

/// Scores of boxes that divide the grid evenly, to a voxel. x runs fastest, then y, then z.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QualityByRegion {
    /// Boxes along x, y, z.
    pub shape: [usize; 3],
    /// Centres of the boxes, mm.
    pub centre_mm: Vec<[f64; 3]>,
    /// One score for each box.
    #[serde(flatten)]
    pub scores: PartScores,
}

/// One score for each slice or box. None, `null` in JSON, if it has no light to take a share of.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct PartScores {
    /// Q. None if the truth is dark there.
    pub q: Vec<Option<f64>>,
    /// Best factor on the volume.
    pub scale: Vec<Option<f64>>,
    /// Share of the volume's light in voxels where the truth is zero.
    pub ghost_share: Vec<Option<f64>>,
    /// Share of the true light in voxels where the volume is zero.
    pub missed_share: Vec<Option<f64>>,
    /// sum E0.
    pub truth_sum: Vec<f64>,
    /// sum E1.
    pub volume_sum: Vec<f64>,
}

impl Quality {
    pub(super) fn of(whole: &QualitySums, by_depth: QualityByDepth, by_region: QualityByRegion) -> Self {
        Self {
            q: whole.q(),
            scale: whole.scale(),
            ghost_share: whole.ghost_share(),
            missed_share: whole.missed_share(),
            max_difference: whole.max_difference(),
            truth_voxels: whole.truth_voxels,
            volume_voxels: whole.volume_voxels,
            shared_voxels: whole.shared_voxels,
            truth_sum: whole.truth,
            volume_sum: whole.volume,
            by_depth,
            by_region,
        }
    }
}

impl PartScores {
    pub(super) fn of<'a>(all: impl IntoIterator<Item = &'a QualitySums>) -> Self {
        let mut scores = Self::default();
        for sums in all {
            scores.q.push((sums.truth_square > 0.0).then(|| sums.q()));
            scores.scale.push(sums.scale());
            scores.ghost_share.push(sums.ghost_share());
            scores.missed_share.push(sums.missed_share());
            scores.truth_sum.push(sums.truth);
            scores.volume_sum.push(sums.volume);
        }
        scores
    }
}
