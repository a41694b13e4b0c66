//! Weights of any camera by the engine of `lf_core::weights::Micro`, made where they are used.

use super::plane::{Plane, keep};
use lf_core::weights::{Lines, Micro, MicroImages, RowSet};

/// Image rows are processed in about this number of batches; fewer batches need more memory.
const ROWS_APART: usize = 14;

/// The shares of voxels that the sensor may see in part come from one set of rows in three.
const SHARE_ROWS: usize = 3;

pub(crate) struct MicroWeights<'a> {
    micro: &'a Micro,
    lines: Lines,
    images: MicroImages,
    /// Parts in which a subset's rows are taken.
    parts: usize,
    /// The sum of each voxel's weights.
    shares: Vec<f32>,
    weights_per_voxel: f64,
}

fn parts(subsets: usize) -> usize {
    ROWS_APART.div_ceil(subsets).max(1)
}

impl<'a> MicroWeights<'a> {
    pub(crate) fn new(micro: &'a Micro, indices: &[u64], subsets: usize) -> Self {
        let (lines, parts) = (micro.lines(indices), parts(subsets));
        let weights_per_voxel = micro.weights_per_voxel(&lines);
        let mut this = Self {
            lines,
            images: micro.images(subsets * parts),
            micro,
            parts,
            shares: vec![1.0; indices.len()],
            weights_per_voxel,
        };
        this.measure_shares(subsets == 1);
        this
    }

    /// Estimates the bytes of everything but the voxels' own.
    pub(super) fn estimated_bytes(micro: &Micro, subsets: usize) -> u64 {
        micro.estimated_bytes(subsets * parts(subsets))
    }

    /// Measures the shares of all voxels, or of those that the sensor may see in part: the sum that a voxel sees of an
    /// even image. The others have 1. For a part of the voxels some of the rows are enough, unless a voxel sees nothing
    /// in them.
    fn measure_shares(&mut self, are_all: bool) {
        let whole = self.micro.are_whole(&self.lines);
        let mut beside: Vec<bool> = whole.iter().map(|whole| are_all || !whole).collect();
        if !are_all {
            self.measure_shares_of(&beside, SHARE_ROWS);
            beside.iter_mut().zip(&self.shares).for_each(|(beside, share)| *beside &= *share <= 0.0);
        }
        self.measure_shares_of(&beside, 1);
    }

    /// Measures the shares of some voxels from one set of rows in `apart`.
    fn measure_shares_of(&mut self, voxels: &[bool], apart: usize) {
        // Take only these voxels.
        let count = voxels.iter().filter(|voxel| **voxel).count();
        if count == 0 {
            return;
        }
        let mut lines = self.lines.clone();
        lines.retain(voxels);
        let mut shares = vec![0f32; count];
        // Project an even image back, from one set of rows in `apart`.
        let [width, height] = self.micro.sensor_px();
        let even = vec![1.0; width * height];
        let sets = self.images.step();
        for rows in split(RowSet::ALL, sets).step_by(apart) {
            self.micro.back_project(&lines, &mut shares, rows, &mut self.images, (&even, width), |_, share, sum, _| {
                *share += sum;
            });
        }
        // Scale the sums to all rows.
        let factor = sets as f32 / sets.div_ceil(apart) as f32;
        let places = self.shares.iter_mut().zip(voxels).filter(|(_, voxel)| **voxel);
        places.zip(shares).for_each(|((share, _), measured)| *share = (factor * measured).max(0.0));
    }

    pub(super) fn retain(&mut self, held: &[bool]) {
        self.lines.retain(held);
        keep(&mut self.shares, held);
    }

    pub(super) fn weights(&self) -> u64 {
        (self.weights_per_voxel * self.shares.len() as f64) as u64
    }

    pub(super) fn shares(&self) -> Vec<f32> {
        self.shares.clone()
    }

    pub(crate) fn project(&mut self, rows: RowSet, strengths: &[f32], plane: &mut Plane) {
        for rows in split(rows, self.parts) {
            self.micro.project(&self.lines, strengths, rows, &mut self.images, (&mut plane.values, plane.stride));
        }
    }

    /// See [`super::Operator::back_project`]. The sum of the weights is exact for all rows. For a part of the rows it
    /// is rough where the stop cuts a lenslet's light.
    pub(crate) fn back_project(
        &mut self,
        rows: RowSet,
        plane: &Plane,
        strengths: &mut [f32],
        update: impl Fn(usize, &mut f32, f32, f32) + Sync,
    ) {
        let Self { micro, lines, images, parts, shares, .. } = self;
        if *parts == 1 {
            return micro.back_project(lines, strengths, rows, images, (&plane.values, plane.stride), update);
        }
        let mut sums = vec![[0f32; 2]; strengths.len()];
        for rows in split(rows, *parts) {
            let add = |_: usize, sums: &mut [f32; 2], sum: f32, weight: f32| {
                sums[0] += sum;
                sums[1] += weight;
            };
            micro.back_project(lines, &mut sums, rows, images, (&plane.values, plane.stride), add);
        }
        let is_all = rows == RowSet::ALL;
        for (voxel, (strength, [sum, weight])) in strengths.iter_mut().zip(sums).enumerate() {
            update(voxel, strength, sum, if is_all { shares[voxel] } else { weight });
        }
    }
}

/// Splits the rows of a set into `parts` sets.
fn split(rows: RowSet, parts: usize) -> impl Iterator<Item = RowSet> {
    (0..parts as u32).map(move |n| RowSet { first: rows.first + n * rows.step, step: rows.step * parts as u32 })
}
