//! Weights voxel by voxel, for cameras that are not aligned: kept in memory if they fit, otherwise made at every use.

use super::plane::{Plane, keep};
use super::stored::{Stored, count_weights, pack};
use glam::Vec4;
use lf_core::weights::{RowSet, Scratch};
use lf_core::{Weights, simd::fastest};
use rayon::prelude::*;

/// Blocks of the support. They are projected apart and added in order: any number of threads gives the same sum.
pub(crate) const BLOCKS: usize = 8;

/// Voxels that a thread takes at once.
const RUN: usize = 1 << 12;

/// Weights are kept once they take no more than this part of the memory allowed: the rest is for voxels and images, and
/// for a sample that is off by a quarter. Making them anew takes ten to a hundred times as long.
const KEPT_PART: f64 = 0.6;

pub(super) fn kept_bytes(max_bytes: u64) -> u64 {
    (KEPT_PART * max_bytes as f64) as u64
}

pub(crate) struct VoxelWeights<'a> {
    weights: &'a Weights,
    subsets: usize,
    /// Bytes that kept weights may take.
    most_bytes: u64,
    indices: Vec<u64>,
    /// The projection of each block, in the rows of a subset if weights are kept, otherwise in all.
    planes: Vec<Vec<f32>>,
    /// Weights of all voxels: the number kept, or an estimate from a sample.
    pub(super) count: u64,
    /// None while weights are made at every use.
    pub(super) kept: Option<Stored>,
}

impl<'a> VoxelWeights<'a> {
    /// Weights that are kept if they take no more than `most_bytes`.
    pub(crate) fn new(weights: &'a Weights, indices: &[u64], subsets: usize, most_bytes: u64) -> Self {
        let (indices, planes) = (indices.to_vec(), vec![Vec::new(); BLOCKS]);
        let mut this = Self { weights, subsets, most_bytes, indices, planes, count: 0, kept: None };
        this.keep_if_it_fits();
        this
    }

    /// Bytes of kept weights, while they are made, and of the tables that make them.
    pub(super) fn estimated_bytes(weights: &Weights, voxels: usize, stored_bytes: u64, most_bytes: u64) -> u64 {
        // Sooner or later they are kept, when they fit.
        let lists = Stored::lists_bytes(stored_bytes, voxels);
        stored_bytes.min(most_bytes).saturating_add(lists).saturating_add(weights.table_bytes())
    }

    fn keep_if_it_fits(&mut self) {
        let bytes = Stored::estimated_bytes(self.weights, &self.indices, self.subsets);
        self.kept =
            Stored::fits(bytes, self.most_bytes).then(|| Stored::new(self.weights, &self.indices, self.subsets, bytes));
        self.count = self.kept.as_ref().map_or_else(|| count_weights(self.weights, &self.indices), Stored::count);
    }

    /// Keeps the weights as soon as those of the voxels held fit.
    pub(super) fn retain(&mut self, held: &[bool]) {
        keep(&mut self.indices, held);
        match &mut self.kept {
            Some(kept) => {
                kept.retain(held);
                self.count = kept.count();
            }
            None => self.keep_if_it_fits(),
        }
    }

    pub(super) fn shares(&self) -> Vec<f32> {
        if let Some(kept) = &self.kept {
            return (0..self.indices.len()).into_par_iter().map(|voxel| kept.share(voxel)).collect();
        }
        let share = |scratch: &mut Scratch, index: &u64| {
            let mut all = 0.0;
            let voxel = self.weights.grid().voxel(*index);
            self.weights.runs(voxel, scratch, RowSet::ALL, |_, _, share, columns| {
                all += share * columns.iter().sum::<f32>();
            });
            all
        };
        self.indices.par_iter().map_init(Scratch::default, share).collect()
    }

    pub(super) fn project(&mut self, rows: RowSet, strengths: &[f32], plane: &mut Plane) {
        let block = self.indices.len().div_ceil(BLOCKS).max(1);
        let (weights, indices, kept, stride) = (self.weights, &self.indices, &self.kept, plane.stride);
        let first = |row: usize| if kept.is_some() { row / rows.step as usize * stride } else { row * stride };
        let length = first(plane.values.len() / stride - 1) + stride;
        // Project each block of voxels onto a plane of its own.
        self.planes.par_iter_mut().enumerate().for_each(|(n, values)| {
            values.resize(length, 0.0);
            let (from, step) = if kept.is_some() { (0, 1) } else { (rows.first as usize, rows.step as usize) };
            values.chunks_mut(stride).skip(from).step_by(step).for_each(|row| row.fill(0.0));
            let voxels = (n * block).min(indices.len())..((n + 1) * block).min(indices.len());
            match kept {
                Some(kept) => fastest(
                    #[inline(always)]
                    || kept.add(voxels, rows, strengths, values),
                ),
                None => spread(weights, &indices[voxels.clone()], rows, &strengths[voxels], values, stride),
            }
        });
        // Add the planes in their order.
        let planes = &self.planes;
        let image_rows = plane.values.par_chunks_mut(stride).enumerate();
        image_rows.filter(|(row, _)| rows.holds(*row as u32)).for_each(|(row, out)| {
            out.fill(0.0);
            for block in planes {
                let values = &block[first(row)..][..stride];
                out.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            }
        });
    }

    pub(super) fn back_project(
        &self,
        rows: RowSet,
        plane: &Plane,
        strengths: &mut [f32],
        update: impl Fn(usize, &mut f32, f32, f32) + Sync,
    ) {
        let kept = self.kept.as_ref().map(|kept| (kept, pack(plane, rows)));
        strengths.par_chunks_mut(RUN).enumerate().for_each(|(run, strengths)| {
            let first = run * RUN;
            let indices = &self.indices[first..first + strengths.len()];
            if let Some((kept, values)) = &kept {
                fastest(
                    #[inline(always)]
                    || {
                        for (voxel, strength) in (first..).zip(strengths) {
                            let (sum, all) = kept.seen(voxel, rows, values);
                            update(voxel, strength, sum, all);
                        }
                    },
                );
            } else {
                let mut sums = vec![(0.0, 0.0); strengths.len()];
                gather(self.weights, indices, rows, plane, &mut sums);
                for ((voxel, strength), (sum, all)) in (first..).zip(strengths).zip(sums) {
                    update(voxel, strength, sum, all);
                }
            }
        });
    }
}

/// Adds the light of voxels to a plane.
fn spread(weights: &Weights, indices: &[u64], rows: RowSet, strengths: &[f32], values: &mut [f32], stride: usize) {
    fastest(
        #[inline(always)]
        || {
            let mut scratch = Scratch::default();
            for (index, strength) in indices.iter().zip(strengths) {
                weights.runs(weights.grid().voxel(*index), &mut scratch, rows, |row, first, share, columns| {
                    let light = share * strength;
                    let start = row as usize * stride + first as usize;
                    let values = &mut values[start..start + columns.len()];
                    for (values, columns) in values.chunks_exact_mut(4).zip(columns.chunks_exact(4)) {
                        (Vec4::from_slice(values) + light * Vec4::from_slice(columns)).write_to_slice(values);
                    }
                });
            }
        },
    );
}

/// For each voxel the sum of a plane's values by its weights, and of its weights.
fn gather(weights: &Weights, indices: &[u64], rows: RowSet, plane: &Plane, sums: &mut [(f32, f32)]) {
    fastest(
        #[inline(always)]
        || {
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
        },
    );
}
