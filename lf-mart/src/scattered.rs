//! Weights voxel by voxel, for turned and hexagonal lattices.

use crate::operator::{Plane, Rows};
use lf_core::footprint::{Footprint, Scratch};
use rayon::prelude::*;

/// Parts of the support projected apart and added in order: the sum is the same for any number of threads.
const PARTS: usize = 8;

pub(crate) struct Scattered<'a> {
    footprint: &'a Footprint,
    indices: Vec<u64>,
    planes: Vec<Plane>,
}

impl<'a> Scattered<'a> {
    pub(crate) fn new(footprint: &'a Footprint, indices: &[u64]) -> Self {
        let (width, height) = footprint.sensor();
        let planes = (0..PARTS).map(|_| Plane::new(width, height)).collect();
        Self { footprint, indices: indices.to_vec(), planes }
    }

    pub(crate) fn project(&mut self, rows: Rows, strengths: &[f32], plane: &mut Plane) {
        let part = self.indices.len().div_ceil(PARTS).max(1);
        let mine = |row: usize| row % rows.subsets == rows.subset;
        let (footprint, indices) = (self.footprint, &self.indices);
        self.planes.par_iter_mut().enumerate().for_each(|(n, plane)| {
            for row in plane.values.chunks_mut(plane.stride).skip(rows.subset).step_by(rows.subsets) {
                row.fill(0.0);
            }
            let range = (n * part).min(indices.len())..((n + 1) * part).min(indices.len());
            let mut scratch = Scratch::default();
            for (index, strength) in indices[range.clone()].iter().zip(&strengths[range]) {
                let voxel = footprint.grid().voxel(*index);
                let stride = plane.stride;
                let values = &mut plane.values;
                footprint.visit(
                    voxel,
                    &mut scratch,
                    |row| mine(row as usize),
                    |column, row, weight| {
                        values[row as usize * stride + column as usize] += weight * strength;
                    },
                );
            }
        });
        let planes = &self.planes;
        let stride = plane.stride;
        plane.values.par_chunks_mut(stride).enumerate().filter(|(row, _)| mine(*row)).for_each(|(row, out)| {
            out.fill(0.0);
            for part in planes {
                for (sum, value) in out.iter_mut().zip(&part.values[row * stride..(row + 1) * stride]) {
                    *sum += value;
                }
            }
        });
    }

    pub(crate) fn back_project(
        &self,
        rows: Rows,
        plane: &Plane,
        strengths: &mut [f32],
        update: impl Fn(&mut f32, f32, f32) + Sync,
    ) {
        strengths.par_iter_mut().zip(&self.indices).with_min_len(64).for_each_init(
            Scratch::default,
            |scratch, (strength, index)| {
                let (mut sum, mut share) = (0.0, 0.0);
                let mine = |row: u32| row as usize % rows.subsets == rows.subset;
                self.footprint.visit(self.footprint.grid().voxel(*index), scratch, mine, |column, row, weight| {
                    sum += weight * plane.values[row as usize * plane.stride + column as usize];
                    share += weight;
                });
                update(strength, sum, share);
            },
        );
    }
}
