//! How well a reconstruction agrees with the true volume.
//!
//! ```text
//! Q = sum E1 E0 / sqrt(sum E1^2 * sum E0^2)        E1 reconstruction, E0 truth, over all voxels of the grid
//! ```
//!
//! Departure: the paper's Eq. 2 prints one sum under the root. The measure meant is the normalised correlation of
//! Elsinga et al. 2006, Exp. Fluids, with two sums. Only with two does a volume score 1 against itself.
//!
//! Voxels that a file does not hold are zero. A stored zero counts as a voxel that is not held.

use super::score::{PartScores, Quality, QualityByDepth, QualityByRegion, QualitySums};
use crate::scores::light::VoxelLight;
use lf_core::{Grid, Refusal};
use ndarray::Array3;
use std::cmp::Ordering;

/// Scores `volume` against `truth`: as a whole, by slices, and by `regions` boxes along x, y, z. Refuses different
/// grids, and more regions than voxels along an axis.
pub fn quality(truth: VoxelLight, volume: VoxelLight, regions: [usize; 3]) -> Result<Quality, Refusal> {
    let grid = truth.grid;
    if !grid.agrees_with(volume.grid) {
        return Err(Refusal::new(volume.grid.to_string(), format!("wanted the truth's {grid}")));
    }
    if (0..3).any(|axis| regions[axis] == 0 || regions[axis] > grid.shape[axis]) {
        return Err(Refusal::new(grid.to_string(), format!("wanted at least a voxel for each of {regions:?} regions")));
    }
    // Add every voxel to its slice and to its box.
    let [nx, ny, nz] = regions;
    let mut slices = vec![QualitySums::default(); grid.shape[2]];
    let mut boxes = Array3::from_elem([nz, ny, nx], QualitySums::default());
    for_each_pair(truth, volume, |index, e0, e1| {
        let voxel = grid.voxel(index);
        let sums = QualitySums::of(e0, e1);
        slices[voxel[2]].add(&sums);
        let [i, j, k] = [0, 1, 2].map(|axis| voxel[axis] * regions[axis] / grid.shape[axis]);
        boxes[[k, j, i]].add(&sums);
    });
    // The whole is the sum of the slices, in the order of z.
    let mut whole = QualitySums::default();
    slices.iter().for_each(|slice| whole.add(slice));
    let by_depth = QualityByDepth {
        z_mm: (0..grid.shape[2]).map(|k| grid.centre_mm(2, k)).collect(),
        scores: PartScores::of(&slices),
    };
    let by_region = QualityByRegion {
        shape: regions,
        centre_mm: boxes.indexed_iter().map(|((k, j, i), _)| box_centre_mm(grid, regions, [i, j, k])).collect(),
        scores: PartScores::of(&boxes),
    };
    Ok(Quality { whole: whole.score(), by_depth, by_region })
}

/// Bytes of a slice or a box: its sums and its numbers.
const PART_BYTES: usize = size_of::<QualitySums>() + PartScores::BYTES;

/// Upper bound of the bytes that [`quality`] takes beside the volumes.
pub fn quality_bytes(grid: &Grid, regions: [usize; 3]) -> f64 {
    let boxes: f64 = regions.iter().map(|count| *count as f64).product();
    let [slice, region] = [size_of::<f64>(), size_of::<[f64; 3]>()].map(|place| (PART_BYTES + place) as f64);
    slice * grid.shape[2] as f64 + region * boxes
}

/// Centre of a box: half way between the centres of its first and its last voxel.
fn box_centre_mm(grid: &Grid, regions: [usize; 3], place: [usize; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        // Voxel i is in box i * regions / shape, rounded down.
        let first = |place: usize| (place * grid.shape[axis]).div_ceil(regions[axis]);
        let ends = [first(place[axis]), first(place[axis] + 1) - 1];
        0.5 * ends.map(|voxel| grid.centre_mm(axis, voxel)).iter().sum::<f64>()
    })
}

/// Visits the voxels that either volume holds, by rising index: linear index, true intensity, intensity of the volume.
fn for_each_pair(truth: VoxelLight, volume: VoxelLight, mut visit: impl FnMut(u64, f64, f64)) {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid { shape: [4, 3, 2], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [-0.15, -0.1, -0.5] }
    }

    fn score(truth: (&[u64], &[f32]), volume: (&[u64], &[f32])) -> Quality {
        let grid = grid();
        let light = |(indices, intensity)| VoxelLight { grid: &grid, indices, intensity };
        quality(light(truth), light(volume), [2, 1, 2]).unwrap()
    }

    #[test]
    fn score_by_hand() {
        // E0 = 3 at 1, 4 at 5, 5 at 9; E1 = 2 at 0, 6 at 5, 3 at 9: products 24 + 15, squares 50 and 49.
        let found = score((&[1, 5, 9], &[3.0, 4.0, 5.0]), (&[0, 5, 9], &[2.0, 6.0, 3.0]));
        assert!((found.whole.q - 39.0 / (50f64 * 49.0).sqrt()).abs() < 1e-15);
        assert!((found.whole.scale.unwrap() - 39.0 / 49.0).abs() < 1e-15);
        assert!((found.whole.ghost_share.unwrap() - 2.0 / 11.0).abs() < 1e-15);
        assert!((found.whole.missed_share.unwrap() - 3.0 / 12.0).abs() < 1e-15);
        assert_eq!(found.whole.max_difference, Some(3.0 / 5.0));
        assert_eq!((found.whole.truth_voxels, found.whole.volume_voxels, found.whole.shared_voxels), (3, 3, 2));
        assert_eq!((found.whole.truth_sum, found.whole.volume_sum), (12.0, 11.0));
    }

    #[test]
    fn a_scaled_copy_scores_one_and_gives_its_scale() {
        let truth: &[f32] = &[3.0, 0.1, 1e-20, 7e15];
        let copy: Vec<f32> = truth.iter().map(|e| e / 4.0).collect();
        let found = score((&[1, 5, 9, 23], truth), (&[1, 5, 9, 23], &copy));
        assert!((found.whole.q - 1.0).abs() < 1e-15 && found.whole.q <= 1.0);
        assert!((found.whole.scale.unwrap() - 4.0).abs() < 1e-14);
        assert_eq!((found.whole.ghost_share, found.whole.missed_share), (Some(0.0), Some(0.0)));
    }

    #[test]
    fn stored_zeros_change_nothing() {
        let sparse = score((&[1, 5], &[3.0, 4.0]), (&[5], &[1.0]));
        assert_eq!(sparse, score((&[0, 1, 5, 8], &[0.0, 3.0, 4.0, 0.0]), (&[1, 5, 7], &[0.0, 1.0, -0.0])));
    }

    #[test]
    fn darkness_scores_zero_and_has_no_shares() {
        let dark = score((&[1], &[3.0]), (&[], &[]));
        assert_eq!(
            (dark.whole.q, dark.whole.scale, dark.whole.ghost_share, dark.whole.missed_share),
            (0.0, None, None, Some(1.0))
        );
        let both = score((&[], &[]), (&[2], &[0.0]));
        assert_eq!((both.whole.q, both.whole.missed_share), (0.0, None));
        assert!(!serde_json::to_string(&both).unwrap().contains("NaN"));
    }

    // Methods that are not multiplicative leave negative light. A share of a plain sum could exceed 1 or change sign.
    #[test]
    fn negative_light_counts_by_its_size() {
        let found = score((&[1, 2, 5], &[3.0, -1.0, 4.0]), (&[0, 2, 5], &[-2.0, 1.0, 1.0]));
        assert_eq!((found.whole.ghost_share, found.whole.missed_share), (Some(0.5), Some(3.0 / 8.0)));
        assert_eq!((found.whole.truth_sum, found.whole.volume_sum), (6.0, 0.0));
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
            VoxelLight { grid: &grid, indices: &truth.0, intensity: &truth.1 },
            VoxelLight { grid: &grid, indices: &volume.0, intensity: &volume.1 },
            [1, 1, 1],
        )
        .unwrap();
        assert!((found.whole.q - dot(&e0, &e1) / (dot(&e0, &e0) * dot(&e1, &e1)).sqrt()).abs() < 1e-14);
        assert!((found.whole.scale.unwrap() - dot(&e0, &e1) / dot(&e1, &e1)).abs() < 1e-14);
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
        let light = |grid| VoxelLight { grid, indices: &[], intensity: &[] };
        let refusal = quality(light(&a), light(&b), [1; 3]).unwrap_err();
        assert!(refusal.found.contains("4 x 4 x 2") && refusal.wanted.contains("4 x 3 x 2"));
    }
}
