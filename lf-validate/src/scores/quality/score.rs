//! The numbers that are printed about the quality of a volume, and the sums over voxels that they follow from.

use serde::Serialize;

/// The score of a reconstructed volume against the truth: as a whole, by slices and by boxes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// The whole volume.
    #[serde(flatten)]
    pub whole: VolumeScore,
    pub(crate) by_depth: QualityByDepth,
    pub(crate) by_region: QualityByRegion,
}

/// The score of a reconstructed volume, E1, against the truth, E0. A share is None, `null` in JSON, without light to
/// take it of; the scale is None if the volume is dark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VolumeScore {
    /// Q. 0 if either volume has no light.
    pub q: f64,
    /// sum E1 E0 / sum E1^2: the factor on the volume that brings it closest to the truth in least squares. A share of
    /// 1 - q^2 of the truth's energy is then left over.
    pub(crate) scale: Option<f64>,
    /// Share of sum |E1| in voxels where E0 is zero. It depends on where the truth ends the image of a particle.
    pub ghost_share: Option<f64>,
    /// Share of sum |E0| in voxels where E1 is zero.
    pub missed_share: Option<f64>,
    /// Largest |E1 - E0| of a voxel over the largest |E0|.
    pub max_difference: Option<f64>,
    /// Voxels of the truth that are not zero.
    pub truth_voxels: u64,
    /// Voxels of the volume that are not zero.
    pub volume_voxels: u64,
    pub(crate) shared_voxels: u64,
    pub(crate) truth_sum: f64,
    pub(crate) volume_sum: f64,
}

/// Scores of every slice of the grid, in the order of z.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct QualityByDepth {
    /// Centres of the slices.
    pub z_mm: Vec<f64>,
    #[serde(flatten)]
    pub scores: PartScores,
}

/// Scores of boxes that divide the grid evenly, to a voxel. x runs fastest, then y, then z.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct QualityByRegion {
    /// Boxes along x, y, z.
    pub shape: [usize; 3],
    pub centre_mm: Vec<[f64; 3]>,
    #[serde(flatten)]
    pub scores: PartScores,
}

/// The numbers of [`Quality`] for each slice or box.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(crate) struct PartScores {
    /// None if the truth is dark there.
    pub q: Vec<Option<f64>>,
    pub scale: Vec<Option<f64>>,
    pub ghost_share: Vec<Option<f64>>,
    pub missed_share: Vec<Option<f64>>,
    pub truth_sum: Vec<f64>,
    pub volume_sum: Vec<f64>,
}

impl PartScores {
    /// Every list is made in its full length: one that grows may take twice its bytes.
    pub(super) fn of<'a>(all: impl IntoIterator<Item = &'a QualitySums> + Copy) -> Self {
        Self {
            q: list(all, |sums| sums.has_truth().then(|| sums.score().q)),
            scale: list(all, |sums| sums.score().scale),
            ghost_share: list(all, |sums| sums.score().ghost_share),
            missed_share: list(all, |sums| sums.score().missed_share),
            truth_sum: list(all, |sums| sums.score().truth_sum),
            volume_sum: list(all, |sums| sums.score().volume_sum),
        }
    }

    /// Bytes of the numbers of a part.
    pub(super) const BYTES: usize = 4 * size_of::<Option<f64>>() + 2 * size_of::<f64>();
}

fn list<'a, T>(all: impl IntoIterator<Item = &'a QualitySums>, number: impl Fn(&QualitySums) -> T) -> Vec<T> {
    all.into_iter().map(number).collect()
}

/// Sums over a set of voxels: the whole grid, a slice or a box. E0 is the truth, E1 the volume.
#[derive(Debug, Clone, Default)]
pub(super) struct QualitySums {
    /// Sums of E1 E0, E0^2, E1^2, E0, E1, |E0|, |E1|, of |E1| where E0 is 0, and of |E0| where E1 is 0.
    sums: [f64; 9],
    /// Largest |E1 - E0| and |E0|.
    largest: [f64; 2],
    /// Voxels that are not 0: of the truth, of the volume, of both.
    voxels: [u64; 3],
}

impl QualitySums {
    /// One voxel.
    #[inline]
    pub fn of(e0: f64, e1: f64) -> Self {
        let (true_light, light) = (e0 != 0.0, e1 != 0.0);
        let ghost = if true_light { 0.0 } else { e1.abs() };
        let missed = if light { 0.0 } else { e0.abs() };
        Self {
            sums: [e0 * e1, e0 * e0, e1 * e1, e0, e1, e0.abs(), e1.abs(), ghost, missed],
            largest: [(e1 - e0).abs(), e0.abs()],
            voxels: [true_light, light, true_light && light].map(u64::from),
        }
    }

    /// Adds other voxels.
    #[inline]
    pub fn add(&mut self, other: &Self) {
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, more)| *sum += more);
        self.largest.iter_mut().zip(other.largest).for_each(|(largest, more)| *largest = largest.max(more));
        self.voxels.iter_mut().zip(other.voxels).for_each(|(count, more)| *count += more);
    }

    /// Whether the truth has light.
    fn has_truth(&self) -> bool {
        self.voxels[0] > 0
    }

    pub fn score(&self) -> VolumeScore {
        let [product, truth_square, volume_square, truth_sum, volume_sum, truth_size, volume_size, ghost, missed] =
            self.sums;
        let ([difference, truth_peak], [truth_voxels, volume_voxels, shared_voxels]) = (self.largest, self.voxels);
        // None if the whole is 0.
        let ratio = |part: f64, whole: f64| (whole > 0.0).then(|| part / whole);
        // The root of each sum: the product of the sums may overflow. Only rounding brings Q above 1.
        let norm = truth_square.sqrt() * volume_square.sqrt();
        VolumeScore {
            q: ratio(product, norm).map_or(0.0, |q| q.clamp(-1.0, 1.0)),
            scale: ratio(product, volume_square),
            ghost_share: ratio(ghost, volume_size),
            missed_share: ratio(missed, truth_size),
            max_difference: ratio(difference, truth_peak),
            truth_voxels,
            volume_voxels,
            shared_voxels,
            truth_sum,
            volume_sum,
        }
    }
}
