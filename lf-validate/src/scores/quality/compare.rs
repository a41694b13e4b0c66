//! How well a reconstruction stands for the true volume.
//!
//! ```text
//! Q = sum E1 E0 / sqrt(sum E1^2 * sum E0^2)        E1 reconstruction, E0 truth, over every voxel of the grid
//! ```
//!
//! Departure: the paper's Eq. 2 prints one sum under the root. The measure meant is the normalised correlation of Elsinga
//! et al. 2006, Exp. Fluids 41:933, with a sum of each; only so is a volume against itself 1.
//!
//! Voxels that a file does not hold are zero, and a stored zero counts as one that is not held.

use crate::scores::light::Light;
use lf_core::grid::Grid;
use serde::Serialize;
use std::cmp::Ordering;

/// The score of a volume against the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// Q; 0 where either volume has no light.
    pub q: f64,
    /// sum E1 E0 / sum E1^2: the factor on the volume that brings it closest to the truth in least squares. The truth's
    /// energy left over is then 1 - q^2. `null` where the volume has no light.
    pub scale: Option<f64>,
    /// Share of sum |E1| in voxels where E0 is zero: light where there was none. It counts from where the truth's
    /// particle images were cut. `null` where the volume has no light.
    pub ghost_share: Option<f64>,
    /// Share of sum |E0| in voxels where E1 is zero: light that was lost. `null` where the truth has no light.
    pub missed_share: Option<f64>,
    /// Largest |E1 - E0| of a voxel over the largest |E0|. `null` where the truth has no light.
    pub max_difference: Option<f64>,
    /// Voxels of the truth that are not zero.
    pub truth_voxels: u64,
    /// Voxels of the volume that are not zero.
    pub volume_voxels: u64,
    /// Voxels in which neither is zero.
    pub shared_voxels: u64,
    /// sum E0.
    pub truth_sum: f64,
    /// sum E1.
    pub volume_sum: f64,
    /// The same by slices across z.
    pub by_depth: ByDepth,
    /// The same by boxes.
    pub by_region: ByRegion,
}

/// Scores of every slice of the grid, in the order of z.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ByDepth {
    /// Centres of the slices, mm.
    pub z_mm: Vec<f64>,
    /// The scores.
    #[serde(flatten)]
    pub scores: Scores,
}

/// Scores of boxes that divide the grid evenly to a voxel, x fastest, then y, then z.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ByRegion {
    /// Boxes along x, y, z.
    pub shape: [usize; 3],
    /// Centres of the boxes, mm.
    pub centre_mm: Vec<[f64; 3]>,
    /// The scores.
    #[serde(flatten)]
    pub scores: Scores,
}

/// One score for each part of a volume; none, `null`, where the part lacks the light that it is a share of.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Scores {
    /// Q of the part alone; none where its truth is dark.
    pub q: Vec<Option<f64>>,
    /// Best factor of the part alone.
    pub scale: Vec<Option<f64>>,
    /// Share of the part's light in voxels where the truth is zero.
    pub ghost_share: Vec<Option<f64>>,
    /// Share of the part's true light in voxels that the volume leaves zero.
    pub missed_share: Vec<Option<f64>>,
    /// sum E0 of the part.
    pub truth_sum: Vec<f64>,
    /// sum E1 of the part.
    pub volume_sum: Vec<f64>,
}

impl Scores {
    fn of(parts: &[Sums]) -> Self {
        let each = |score: fn(&Sums) -> Option<f64>| parts.iter().map(score).collect();
        Self {
            q: each(|sums| (sums.truth_square > 0.0).then(|| sums.q())),
            scale: each(Sums::scale),
            ghost_share: each(Sums::ghost_share),
            missed_share: each(Sums::missed_share),
            truth_sum: parts.iter().map(|sums| sums.truth).collect(),
            volume_sum: parts.iter().map(|sums| sums.volume).collect(),
        }
    }
}

/// Scores `volume` against `truth`, as a whole, by slices and by `regions` boxes along x, y, z. One merge of the two index
/// lists.
///
/// # Errors
/// Two phrases, found and wanted, where the grids disagree, or a grid has fewer voxels than there should be regions.
pub fn quality(truth: Light, volume: Light, regions: [usize; 3]) -> Result<Quality, (String, String)> {
    let grid = truth.grid;
    if !grid.agrees_with(volume.grid) {
        return Err((volume.grid.to_string(), format!("wanted the truth's {grid}")));
    }
    if (0..3).any(|axis| regions[axis] == 0 || regions[axis] > grid.shape[axis]) {
        return Err((grid.to_string(), format!("wanted at least a voxel for each of {regions:?} regions")));
    }
    let mut slices = vec![Sums::default(); grid.shape[2]];
    let mut boxes = vec![Sums::default(); regions.iter().product()];
    for_each_pair(truth, volume, |index, e0, e1| {
        let at = grid.voxel(index);
        slices[at[2]].add(e0, e1);
        let [i, j, k] = [0, 1, 2].map(|axis| at[axis] * regions[axis] / grid.shape[axis]);
        boxes[i + regions[0] * (j + regions[1] * k)].add(e0, e1);
    });
    let whole = slices.iter().fold(Sums::default(), Sums::with);
    let by_depth =
        ByDepth { z_mm: (0..grid.shape[2]).map(|k| grid.centre_mm(2, k)).collect(), scores: Scores::of(&slices) };
    let by_region = ByRegion {
        shape: regions,
        centre_mm: (0..boxes.len()).map(|n| box_centre_mm(grid, regions, n)).collect(),
        scores: Scores::of(&boxes),
    };
    Ok(whole.quality(by_depth, by_region))
}

/// The middle of a box: half way between the first and the last of its voxels.
fn box_centre_mm(grid: &Grid, regions: [usize; 3], n: usize) -> [f64; 3] {
    let number = [n % regions[0], n / regions[0] % regions[1], n / regions[0] / regions[1]];
    [0, 1, 2].map(|axis| {
        // Voxel i is in box i * regions / shape, rounded down.
        let first = |number: usize| (number * grid.shape[axis]).div_ceil(regions[axis]);
        let ends = [first(number[axis]), first(number[axis] + 1) - 1];
        0.5 * ends.map(|voxel| grid.centre_mm(axis, voxel)).iter().sum::<f64>()
    })
}

/// Visits the voxels that either volume holds, in rising order: linear index, truth, volume.
fn for_each_pair(truth: Light, volume: Light, mut visit: impl FnMut(u64, f64, f64)) {
    let (mut t, mut v) = (0, 0);
    while t < truth.indices.len() || v < volume.indices.len() {
        let true_index = truth.indices.get(t).copied().unwrap_or(u64::MAX);
        let index = volume.indices.get(v).copied().unwrap_or(u64::MAX);
        let order = true_index.cmp(&index);
        let (mut e0, mut e1) = (0.0, 0.0);
        if order != Ordering::Greater {
            e0 = f64::from(truth.intensity[t]);
            t += 1;
        }
        if order != Ordering::Less {
            e1 = f64::from(volume.intensity[v]);
            v += 1;
        }
        visit(true_index.min(index), e0, e1);
    }
}

/// What a score of any set of voxels is made of.
#[derive(Debug, Clone, Default)]
struct Sums {
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

impl Sums {
    #[inline]
    fn add(&mut self, e0: f64, e1: f64) {
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

    /// Both sets of voxels together.
    fn with(self, other: &Self) -> Self {
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

    fn q(&self) -> f64 {
        // A root of each sum, and not of their product, which may overflow; and Q passes 1 by rounding only.
        let norm = self.truth_square.sqrt() * self.volume_square.sqrt();
        if norm > 0.0 { (self.product / norm).clamp(-1.0, 1.0) } else { 0.0 }
    }

    fn scale(&self) -> Option<f64> {
        ratio(self.product, self.volume_square)
    }

    fn ghost_share(&self) -> Option<f64> {
        ratio(self.ghost, self.volume_size)
    }

    fn missed_share(&self) -> Option<f64> {
        ratio(self.missed, self.truth_size)
    }

    fn quality(&self, by_depth: ByDepth, by_region: ByRegion) -> Quality {
        Quality {
            q: self.q(),
            scale: self.scale(),
            ghost_share: self.ghost_share(),
            missed_share: self.missed_share(),
            max_difference: ratio(self.difference, self.truth_peak),
            truth_voxels: self.truth_voxels,
            volume_voxels: self.volume_voxels,
            shared_voxels: self.shared_voxels,
            truth_sum: self.truth,
            volume_sum: self.volume,
            by_depth,
            by_region,
        }
    }
}

fn ratio(part: f64, whole: f64) -> Option<f64> {
    (whole > 0.0).then(|| part / whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid { shape: [4, 3, 2], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [-0.15, -0.1, -0.5] }
    }

    fn score(truth: (&[u64], &[f32]), volume: (&[u64], &[f32])) -> Quality {
        let grid = grid();
        let light = |(indices, intensity)| Light { grid: &grid, indices, intensity };
        quality(light(truth), light(volume), [2, 1, 2]).unwrap()
    }

    #[test]
    fn score_by_hand() {
        // E0 = 3 at 1, 4 at 5, 5 at 9; E1 = 2 at 0, 6 at 5, 3 at 9: products 24 + 15, squares 50 and 49.
        let found = score((&[1, 5, 9], &[3.0, 4.0, 5.0]), (&[0, 5, 9], &[2.0, 6.0, 3.0]));
        assert!((found.q - 39.0 / (50f64 * 49.0).sqrt()).abs() < 1e-15);
        assert!((found.scale.unwrap() - 39.0 / 49.0).abs() < 1e-15);
        assert!((found.ghost_share.unwrap() - 2.0 / 11.0).abs() < 1e-15);
        assert!((found.missed_share.unwrap() - 3.0 / 12.0).abs() < 1e-15);
        assert_eq!(found.max_difference, Some(3.0 / 5.0));
        assert_eq!((found.truth_voxels, found.volume_voxels, found.shared_voxels), (3, 3, 2));
        assert_eq!((found.truth_sum, found.volume_sum), (12.0, 11.0));
    }

    #[test]
    fn a_scaled_copy_scores_one_and_gives_its_scale() {
        let truth: &[f32] = &[3.0, 0.1, 1e-20, 7e15];
        let copy: Vec<f32> = truth.iter().map(|e| e / 4.0).collect();
        let found = score((&[1, 5, 9, 23], truth), (&[1, 5, 9, 23], &copy));
        assert!((found.q - 1.0).abs() < 1e-15 && found.q <= 1.0);
        assert!((found.scale.unwrap() - 4.0).abs() < 1e-14);
        assert_eq!((found.ghost_share, found.missed_share), (Some(0.0), Some(0.0)));
    }

    #[test]
    fn stored_zeros_change_nothing() {
        let sparse = score((&[1, 5], &[3.0, 4.0]), (&[5], &[1.0]));
        assert_eq!(sparse, score((&[0, 1, 5, 8], &[0.0, 3.0, 4.0, 0.0]), (&[1, 5, 7], &[0.0, 1.0, -0.0])));
    }

    #[test]
    fn darkness_scores_zero_and_has_no_shares() {
        let dark = score((&[1], &[3.0]), (&[], &[]));
        assert_eq!((dark.q, dark.scale, dark.ghost_share, dark.missed_share), (0.0, None, None, Some(1.0)));
        let both = score((&[], &[]), (&[2], &[0.0]));
        assert_eq!((both.q, both.missed_share), (0.0, None));
        assert!(!serde_json::to_string(&both).unwrap().contains("NaN"));
    }

    // Methods that are not multiplicative leave negative light: a share of a plain sum would pass 1 or change sign.
    #[test]
    fn negative_light_counts_by_its_size() {
        let found = score((&[1, 2, 5], &[3.0, -1.0, 4.0]), (&[0, 2, 5], &[-2.0, 1.0, 1.0]));
        assert_eq!((found.ghost_share, found.missed_share), (Some(0.5), Some(3.0 / 8.0)));
        assert_eq!((found.truth_sum, found.volume_sum), (6.0, 0.0));
    }

    #[test]
    fn merge_equals_the_dense_sums() {
        let grid = Grid { shape: [10, 10, 10], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let held = |stride: u64| -> (Vec<u64>, Vec<f32>) {
            (0..1000).filter(|i| i * i % stride < 3).map(|i| (i, (i as f32 * 0.37).sin().abs())).unzip()
        };
        let (truth, volume) = (held(7), held(11));
        let dense = |(indices, values): &(Vec<u64>, Vec<f32>)| {
            let mut all = vec![0.0; 1000];
            indices.iter().zip(values).for_each(|(&i, &e)| all[i as usize] = f64::from(e));
            all
        };
        let (e0, e1) = (dense(&truth), dense(&volume));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let found = quality(
            Light { grid: &grid, indices: &truth.0, intensity: &truth.1 },
            Light { grid: &grid, indices: &volume.0, intensity: &volume.1 },
            [1, 1, 1],
        )
        .unwrap();
        assert!((found.q - dot(&e0, &e1) / (dot(&e0, &e0) * dot(&e1, &e1)).sqrt()).abs() < 1e-14);
        assert!((found.scale.unwrap() - dot(&e0, &e1) / dot(&e1, &e1)).abs() < 1e-14);
    }

    #[test]
    fn grids_agree_to_rounding_and_no_further() {
        let mut other = grid();
        other.origin_mm[0] += 1e-15;
        assert!(grid().agrees_with(&other));
        other.origin_mm[0] += 1e-6;
        assert!(!grid().agrees_with(&other));
        other = grid();
        other.spacing_mm[2] *= 1.0 + 1e-8;
        assert!(!grid().agrees_with(&other));
        other = grid();
        other.shape[1] = 4;
        let (a, b) = (grid(), other);
        let light = |grid| Light { grid, indices: &[], intensity: &[] };
        let (found, wanted) = quality(light(&a), light(&b), [1; 3]).unwrap_err();
        assert!(found.contains("4 x 4 x 2") && wanted.contains("4 x 3 x 2"));
    }
}
