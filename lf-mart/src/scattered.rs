//! Weights voxel by voxel, where profiles of columns and rows do not serve.

use crate::kernel_lenslets::{Buffers, gather, spread};
use crate::operator::{Plane, keep};
use lf_core::weights::{Footprint, RowSet};
use rayon::prelude::*;

/// Parts of the support projected apart and added in order: the sum is the same for any number of threads.
const PARTS: usize = 8;

/// Weights are kept once those of all voxels held take no more than this part of the memory allowed; before, they are
/// made anew at every use, which takes ten to a hundred times as long.
const KEPT_PART: f64 = 0.8;

/// Bytes that kept weights may take where so many are allowed for all.
pub(crate) fn kept_bytes(max_bytes: u64) -> u64 {
    (KEPT_PART * max_bytes as f64) as u64
}

pub(crate) struct Scattered<'a> {
    footprint: &'a Footprint,
    subsets: usize,
    /// Bytes that kept weights may take.
    most_bytes: u64,
    indices: Vec<u64>,
    planes: Vec<Plane>,
    /// Weights of all voxels: as many as are kept, or an estimate from a sample.
    weights: u64,
    kept: Option<Kept>,
}

/// A place in a [`Plane`] and the weight on it.
#[derive(Clone, Copy)]
struct Weight {
    place: u32,
    weight: f32,
}

/// Bytes of a kept weight.
pub(crate) const WEIGHT_BYTES: u64 = size_of::<Weight>() as u64;

/// All weights, voxel by voxel, subset by subset.
struct Kept {
    /// Weights of voxel j in subset s are `starts[j * subsets + s] ..` the next.
    starts: Vec<u32>,
    weights: Vec<Weight>,
    subsets: usize,
}

/// Voxels whose weights are counted to foretell those of all.
const SAMPLE: usize = 256;

/// Weights of all voxels, each pixel once, from those of some.
pub(crate) fn count_weights(footprint: &Footprint, indices: &[u64]) -> u64 {
    let sample: Vec<u64> = indices.iter().step_by(indices.len().div_ceil(SAMPLE).max(1)).copied().collect();
    let count = |buffers: &mut Buffers, index: &u64| {
        let mut pixels: Vec<(u32, u32)> = Vec::new();
        buffers.visit(footprint, *index, RowSet::ALL, |row, first, _, columns| {
            pixels.extend((first..).zip(columns).filter(|(_, weight)| **weight > 0.0).map(|(column, _)| (row, column)));
        });
        pixels.sort_unstable();
        pixels.dedup();
        pixels.len()
    };
    let count: usize = sample.par_iter().map_init(Buffers::default, count).sum();
    (count as f64 / sample.len().max(1) as f64 * indices.len() as f64) as u64
}

/// Voxels that a thread takes at once.
pub(crate) const RUN: usize = 1 << 12;

impl Kept {
    fn new(footprint: &Footprint, indices: &[u64], subsets: usize) -> Self {
        let made = |indices: &[u64]| -> Vec<(Vec<u32>, Vec<Weight>)> {
            let of = |merger: &mut Merger, index: &u64| {
                let mut ends = vec![0; subsets];
                let weights = merger.weights(footprint, *index, &mut ends);
                (ends, weights)
            };
            indices.par_iter().with_min_len(64).map_init(|| Merger::new(footprint), of).collect()
        };
        let mut kept = Self { starts: vec![0], weights: Vec::new(), subsets };
        for run in indices.chunks(RUN) {
            for (ends, weights) in made(run) {
                let base = kept.weights.len() as u32;
                kept.starts.extend(ends.iter().map(|end| base + end));
                kept.weights.extend(weights);
            }
        }
        kept
    }

    fn retain(&mut self, held: &[bool]) {
        let (mut end, mut starts) = (0, vec![0]);
        for (voxel, _) in held.iter().enumerate().filter(|(_, held)| **held) {
            for n in voxel * self.subsets..(voxel + 1) * self.subsets {
                let weights = self.starts[n] as usize..self.starts[n + 1] as usize;
                let count = weights.len();
                self.weights.copy_within(weights, end);
                end += count;
                starts.push(end as u32);
            }
        }
        self.weights.truncate(end);
        self.starts = starts;
    }

    fn all_of(&self, voxel: usize) -> &[Weight] {
        let n = voxel * self.subsets;
        &self.weights[self.starts[n] as usize..self.starts[n + self.subsets] as usize]
    }

    #[inline]
    fn of(&self, voxel: usize, rows: RowSet) -> &[Weight] {
        let n = voxel * self.subsets + rows.first as usize;
        &self.weights[self.starts[n] as usize..self.starts[n + 1] as usize]
    }
}

/// Weights are counted in 32 bits; a sample foretells them to a few per cent.
const MOST_WEIGHTS: u64 = u32::MAX as u64 / 10 * 9;

/// Adds up the weights of one voxel; a buffer a thread.
struct Merger {
    buffers: Buffers,
    /// Weight on each place; zero between voxels.
    sums: Vec<f32>,
    places: Vec<u32>,
}

impl Merger {
    fn new(footprint: &Footprint) -> Self {
        let (width, height) = footprint.sensor();
        Self { buffers: Buffers::default(), sums: Plane::new(width, height).values, places: Vec::new() }
    }

    /// Weights of a voxel, each pixel once, by rising subset. `ends` becomes where each subset ends.
    fn weights(&mut self, footprint: &Footprint, index: u64, ends: &mut [u32]) -> Vec<Weight> {
        let stride = Plane::stride(footprint.sensor().0);
        let subsets = ends.len();
        let subset = |place: u32| place as usize / stride % subsets;
        let (sums, places) = (&mut self.sums, &mut self.places);
        self.buffers.visit(footprint, index, RowSet::ALL, |row, first, share, columns| {
            let place = row * stride as u32 + first;
            for (place, weight) in (place..).zip(columns).filter(|(_, weight)| **weight > 0.0) {
                let sum = &mut sums[place as usize];
                if *sum == 0.0 {
                    places.push(place);
                }
                *sum += share * weight;
            }
        });
        let mut next = vec![0u32; ends.len() + 1];
        for place in places.iter() {
            next[subset(*place) + 1] += 1;
        }
        for n in 1..next.len() {
            next[n] += next[n - 1];
        }
        ends.copy_from_slice(&next[1..]);
        let mut weights = vec![Weight { place: 0, weight: 0.0 }; places.len()];
        for place in places.drain(..) {
            let at = &mut next[subset(place)];
            weights[*at as usize] = Weight { place, weight: std::mem::take(&mut sums[place as usize]) };
            *at += 1;
        }
        weights
    }
}

impl<'a> Scattered<'a> {
    pub(crate) fn new(footprint: &'a Footprint, indices: &[u64], subsets: usize, max_bytes: u64) -> Self {
        Self::keeping(footprint, indices, subsets, kept_bytes(max_bytes))
    }

    /// With all weights kept if they take no more than `bytes`.
    pub(crate) fn keeping(footprint: &'a Footprint, indices: &[u64], subsets: usize, bytes: u64) -> Self {
        let (width, height) = footprint.sensor();
        let planes = (0..PARTS).map(|_| Plane::new(width, height)).collect();
        let indices = indices.to_vec();
        let mut this = Self { footprint, subsets, most_bytes: bytes, indices, planes, weights: 0, kept: None };
        this.keep_if_it_fits();
        this
    }

    fn keep_if_it_fits(&mut self) {
        self.weights = count_weights(self.footprint, &self.indices);
        if self.weights <= MOST_WEIGHTS.min(self.most_bytes / WEIGHT_BYTES) {
            let kept = Kept::new(self.footprint, &self.indices, self.subsets);
            self.weights = kept.weights.len() as u64;
            self.kept = Some(kept);
        }
    }

    pub(crate) fn is_remade(&self) -> bool {
        self.kept.is_none()
    }

    /// Forgets the voxels that are not held; keeps the weights of the others as soon as they fit.
    pub(crate) fn retain(&mut self, held: &[bool]) {
        keep(&mut self.indices, held);
        match &mut self.kept {
            Some(kept) => {
                kept.retain(held);
                self.weights = kept.weights.len() as u64;
            }
            None => self.keep_if_it_fits(),
        }
    }

    pub(crate) fn weights(&self) -> u64 {
        self.weights
    }

    pub(crate) fn shares(&self) -> Vec<f32> {
        if let Some(kept) = &self.kept {
            let of = |voxel| kept.all_of(voxel).iter().map(|w| w.weight).sum();
            return (0..self.indices.len()).into_par_iter().map(of).collect();
        }
        let of = |buffers: &mut Buffers, index: &u64| {
            let mut all = 0.0;
            buffers.visit(self.footprint, *index, RowSet::ALL, |_, _, share, columns| {
                all += share * columns.iter().sum::<f32>();
            });
            all
        };
        self.indices.par_iter().map_init(Buffers::default, of).collect()
    }

    pub(crate) fn project(&mut self, rows: RowSet, strengths: &[f32], plane: &mut Plane) {
        let part = self.indices.len().div_ceil(PARTS).max(1);
        let (footprint, indices, kept) = (self.footprint, &self.indices, &self.kept);
        self.planes.par_iter_mut().enumerate().for_each(|(n, plane)| {
            for row in plane.values.chunks_mut(plane.stride).skip(rows.first as usize).step_by(rows.step as usize) {
                row.fill(0.0);
            }
            let voxels = (n * part).min(indices.len())..((n + 1) * part).min(indices.len());
            if let Some(kept) = kept {
                for voxel in voxels {
                    for w in kept.of(voxel, rows) {
                        plane.values[w.place as usize] += w.weight * strengths[voxel];
                    }
                }
            } else {
                spread(footprint, &indices[voxels.clone()], rows, &strengths[voxels], plane);
            }
        });
        let planes = &self.planes;
        let stride = plane.stride;
        let lines = plane.values.par_chunks_mut(stride).enumerate();
        lines.filter(|(row, _)| rows.holds(*row as u32)).for_each(|(row, out)| {
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
        rows: RowSet,
        plane: &Plane,
        strengths: &mut [f32],
        update: impl Fn(usize, &mut f32, f32, f32) + Sync,
    ) {
        let runs = strengths.par_chunks_mut(RUN).enumerate();
        runs.for_each(|(run, strengths)| {
            let first = run * RUN;
            let indices = &self.indices[first..first + strengths.len()];
            if let Some(kept) = &self.kept {
                for (voxel, strength) in (first..).zip(strengths) {
                    let (mut sum, mut all) = (0.0, 0.0);
                    for w in kept.of(voxel, rows) {
                        sum += w.weight * plane.values[w.place as usize];
                        all += w.weight;
                    }
                    update(voxel, strength, sum, all);
                }
            } else {
                let mut sums = vec![(0.0, 0.0); strengths.len()];
                gather(self.footprint, indices, rows, plane, &mut sums);
                for ((voxel, strength), (sum, all)) in (first..).zip(strengths).zip(sums) {
                    update(voxel, strength, sum, all);
                }
            }
        });
    }
}
