//! The two inner loops over the runs of pixels that a voxel lights: spread strengths onto a plane, gather from it.

use super::plane::Plane;
use glam::Vec4;
use lf_core::weights::{RowSet, Scratch};
use lf_core::{Weights, simd::fastest};

/// Adds the light of voxels to a plane.
pub(super) fn spread(weights: &Weights, indices: &[u64], rows: RowSet, strengths: &[f32], plane: &mut Plane) {
    fastest(
        #[inline(always)]
        || spread_inlined(weights, indices, rows, strengths, plane),
    );
}

/// For each voxel the sum of a plane's values by its weights, and of its weights.
pub(super) fn gather(weights: &Weights, indices: &[u64], rows: RowSet, plane: &Plane, sums: &mut [(f32, f32)]) {
    fastest(
        #[inline(always)]
        || gather_inlined(weights, indices, rows, plane, sums),
    );
}

#[inline(always)]
fn spread_inlined(weights: &Weights, indices: &[u64], rows: RowSet, strengths: &[f32], plane: &mut Plane) {
    let mut scratch = Scratch::default();
    for (index, strength) in indices.iter().zip(strengths) {
        weights.runs(weights.grid().voxel(*index), &mut scratch, rows, |row, first, share, columns| {
            let light = share * strength;
            let start = row as usize * plane.stride + first as usize;
            let values = &mut plane.values[start..start + columns.len()];
            for (values, columns) in values.chunks_exact_mut(4).zip(columns.chunks_exact(4)) {
                (Vec4::from_slice(values) + light * Vec4::from_slice(columns)).write_to_slice(values);
            }
        });
    }
}

#[inline(always)]
fn gather_inlined(weights: &Weights, indices: &[u64], rows: RowSet, plane: &Plane, sums: &mut [(f32, f32)]) {
    let mut scratch = Scratch::default();
    for (index, sums) in indices.iter().zip(sums) {
        let (mut sum, mut all) = (Vec4::ZERO, Vec4::ZERO);
        weights.runs(weights.grid().voxel(*index), &mut scratch, rows, |row, first, share, columns| {
            let start = row as usize * plane.stride + first as usize;
            let values = &plane.values[start..start + columns.len()];
            for (values, columns) in values.chunks_exact(4).zip(columns.chunks_exact(4)) {
                let weights = share * Vec4::from_slice(columns);
                sum += weights * Vec4::from_slice(values);
                all += weights;
            }
        });
        *sums = (sum.element_sum(), all.element_sum());
    }
}
