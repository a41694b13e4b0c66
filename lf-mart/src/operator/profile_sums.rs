//! Projection and back-projection over products of profiles, in pieces that fit into a core's cache.

use super::stencils::{LitRow, LitRows};
use super::{plane::Plane, profiles::ProfileWeights};
use lf_core::weights::{Chords, RowSet};
use rayon::prelude::*;
use std::ops::Range;

/// Support voxels that one thread takes at a time when it gathers.
const RUN: usize = 4096;

impl ProfileWeights {
    /// The rows of one subset, within `image_rows`, that a line of voxels lights.
    fn lit(&self, line: usize, rows: RowSet, image_rows: Range<usize>, stride: usize, lit: &mut LitRows) {
        lit.clear();
        let at = line * (self.subsets + 1) + rows.first as usize;
        for n in self.row_starts[at] as usize..self.row_starts[at + 1] as usize {
            let stencil = self.row_shares[n];
            if image_rows.contains(&(stencil.row as usize)) {
                let chords = if self.has_round_stop { self.chords[n] } else { Chords::UNCUT };
                lit.push(LitRow {
                    start: (stencil.row as usize - image_rows.start) * stride,
                    share: stencil.share,
                    chords,
                });
            }
        }
    }

    /// A thread has a band of image rows to itself and goes through the slices. The profiles of one slice and the
    /// band's rows stay in its cache. Light lands on a pixel in the order of the voxels, for any number of threads.
    pub(super) fn project(&self, rows: RowSet, strengths: &[f32], plane: &mut Plane) {
        let stride = plane.stride;
        let bands = plane.values.par_chunks_mut(self.band * stride).enumerate();
        bands.for_each_init(LitRows::default, |lit, (band, out)| {
            // Clear the band's rows of this subset.
            let first_row = band * self.band;
            let band_rows = first_row..first_row + out.len() / stride;
            for row in band_rows.clone().filter(|row| rows.holds(*row as u32)) {
                out[(row - first_row) * stride..][..stride].fill(0.0);
            }
            // Go through the slices, and through the lines of voxels that reach the band.
            for lines in self.reached[band * self.slices..][..self.slices].iter().cloned() {
                for line in lines {
                    let voxels = self.lines[line as usize] as usize..self.lines[line as usize + 1] as usize;
                    if voxels.is_empty() {
                        continue;
                    }
                    // Find the rows that the line lights, then spread each of its voxels onto them.
                    self.lit(line as usize, rows, band_rows.clone(), stride, lit);
                    if lit.rows.is_empty() {
                        continue;
                    }
                    for (strength, profile) in strengths[voxels.clone()].iter().zip(&self.profiles[voxels]) {
                        self.columns.spread(*profile, *strength, lit, out);
                    }
                }
            }
        });
    }

    /// A thread has a run of lines to itself and writes their strengths. The cut into runs cannot change a sum.
    pub(super) fn back_project(
        &self,
        rows: RowSet,
        plane: &Plane,
        strengths: &mut [f32],
        update: impl Fn(usize, &mut f32, f32, f32) + Sync,
    ) {
        // Cut the strengths into runs of whole lines.
        let mut runs: Vec<(usize, usize, &mut [f32])> = Vec::new();
        let (mut rest, mut first) = (strengths, 0);
        for line in 0..self.lines.len() - 1 {
            let length = (self.lines[line + 1] - self.lines[first]) as usize;
            if length >= RUN || line + 2 == self.lines.len() {
                let (run, tail) = rest.split_at_mut(length);
                runs.push((first, line + 1, run));
                (rest, first) = (tail, line + 1);
            }
        }
        // Gather for each voxel of each run, and update its strength.
        let height = plane.values.len() / plane.stride;
        runs.into_par_iter().for_each_init(LitRows::default, |lit, (first, end, run)| {
            let base = self.lines[first] as usize;
            for line in first..end {
                let voxels = self.lines[line] as usize..self.lines[line + 1] as usize;
                if voxels.is_empty() {
                    continue;
                }
                self.lit(line, rows, 0..height, plane.stride, lit);
                if lit.rows.is_empty() {
                    continue;
                }
                for n in voxels {
                    let (sum, weight) = self.columns.gather(self.profiles[n], lit, &plane.values);
                    update(n, &mut run[n - base], sum, weight);
                }
            }
        });
    }
}
