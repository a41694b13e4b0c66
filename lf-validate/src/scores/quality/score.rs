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
            q: list(all, |sums| (sums.truth_square > 0.0).then(|| sums.score().q)),
            scale: list(all, |sums| sums.score().scale),
            ghost_share: list(all, |sums| sums.score().ghost_share),
            missed_share: list(all, |sums| sums.score().missed_share),
            truth_sum: list(all, |sums| sums.truth),
            volume_sum: list(all, |sums| sums.volume),
        }
    }

    /// Bytes of the numbers of a part.
    pub(super) const BYTES: usize = 4 * size_of::<Option<f64>>() + 2 * size_of::<f64>();
}

fn list<'a, T>(all: impl IntoIterator<Item = &'a QualitySums>, number: impl Fn(&QualitySums) -> T) -> Vec<T> {
    all.into_iter().map(number).collect()
}

/// Sums over a set of voxels: the whole grid, a slice or a box.
#[derive(Debug, Clone, Default)]
pub(super) struct QualitySums {
    product: f64,
    truth_square: f64,
    volume_square: f64,
    truth: f64,
    volume: f64,
    truth_size: f64,
    volume_size: f64,
    ghost: f64,
    missed: f64,
    difference: f64,
    truth_peak: f64,
    truth_voxels: u64,
    volume_voxels: u64,
    shared_voxels: u64,
}

impl QualitySums {
    /// Adds a voxel: its true intensity and its reconstructed one.
    #[inline]
    pub fn add(&mut self, e0: f64, e1: f64) {
        self.product += e0 * e1;
        self.truth_square += e0 * e0;
        self.volume_square += e1 * e1;
        self.truth += e0;
        self.volume += e1;
        self.truth_size += e0.abs();
        self.volume_size += e1.abs();
        self.difference = self.difference.max((e1 - e0).abs());
        self.truth_peak = self.truth_peak.max(e0.abs());
        let (true_light, light) = (e0 != 0.0, e1 != 0.0);
        self.truth_voxels += u64::from(true_light);
        self.volume_voxels += u64::from(light);
        self.shared_voxels += u64::from(true_light && light);
        if !true_light {
            self.ghost += e1.abs();
        }
        if !light {
            self.missed += e0.abs();
        }
    }

    /// Sums over two sets of voxels together.
    pub fn with(self, other: &Self) -> Self {
        Self {
            product: self.product + other.product,
            truth_square: self.truth_square + other.truth_square,
            volume_square: self.volume_square + other.volume_square,
            truth: self.truth + other.truth,
            volume: self.volume + other.volume,
            truth_size: self.truth_size + other.truth_size,
            volume_size: self.volume_size + other.volume_size,
            ghost: self.ghost + other.ghost,
            missed: self.missed + other.missed,
            difference: self.difference.max(other.difference),
            truth_peak: self.truth_peak.max(other.truth_peak),
            truth_voxels: self.truth_voxels + other.truth_voxels,
            volume_voxels: self.volume_voxels + other.volume_voxels,
            shared_voxels: self.shared_voxels + other.shared_voxels,
        }
    }

    pub fn score(&self) -> VolumeScore {
        // None if the whole is 0.
        let ratio = |part: f64, whole: f64| (whole > 0.0).then(|| part / whole);
        // The root of each sum: the product of the sums may overflow. Only rounding brings Q above 1.
        let norm = self.truth_square.sqrt() * self.volume_square.sqrt();
        VolumeScore {
            q: ratio(self.product, norm).map_or(0.0, |q| q.clamp(-1.0, 1.0)),
            scale: ratio(self.product, self.volume_square),
            ghost_share: ratio(self.ghost, self.volume_size),
            missed_share: ratio(self.missed, self.truth_size),
            max_difference: ratio(self.difference, self.truth_peak),
            truth_voxels: self.truth_voxels,
            volume_voxels: self.volume_voxels,
            shared_voxels: self.shared_voxels,
            truth_sum: self.truth,
            volume_sum: self.volume,
        }
    }
}
