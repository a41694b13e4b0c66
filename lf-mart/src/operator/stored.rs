//! The weights of voxels in memory, and how many they will be.

use super::plane::Plane;
use lf_core::Weights;
use lf_core::weights::{RowSet, Scratch};
use rayon::prelude::*;

/// Voxels whose weights are counted to foretell the number of all.
const SAMPLE: usize = 256;

/// Limit of the number of stored weights: they are counted in 32 bits, and the sample errs by a few per cent.
const MOST_WEIGHTS: u64 = u32::MAX as u64 / 10 * 9;

/// Voxels that a thread takes at once.
pub(super) const RUN: usize = 1 << 12;

/// A place in a [`Plane`] and the weight on it.
#[derive(Clone, Copy)]
pub(super) struct Weight {
    pub(super) place: u32,
    pub(super) weight: f32,
}

pub(super) const WEIGHT_BYTES: u64 = size_of::<Weight>() as u64;

pub(super) fn fits(count: u64, most_bytes: u64) -> bool {
    count <= MOST_WEIGHTS.min(most_bytes / WEIGHT_BYTES)
}

/// The number of weights of all voxels, each pixel once, from a sample.
pub(crate) fn count_weights(weights: &Weights, indices: &[u64]) -> u64 {
    let sample: Vec<u64> = indices.iter().step_by(indices.len().div_ceil(SAMPLE).max(1)).copied().collect();
    let count = |scratch: &mut Scratch, index: &u64| {
        let mut pixels: Vec<(u32, u32)> = Vec::new();
        weights.runs(weights.grid().voxel(*index), scratch, RowSet::ALL, |row, first, _, columns| {
            pixels.extend((first..).zip(columns).filter(|(_, weight)| **weight > 0.0).map(|(column, _)| (row, column)));
        });
        pixels.sort_unstable();
        pixels.dedup();
        pixels.len()
    };
    let count: usize = sample.par_iter().map_init(Scratch::default, count).sum();
    (count as f64 / sample.len().max(1) as f64 * indices.len() as f64) as u64
}

/// All weights, voxel by voxel, and subset by subset of the image's rows.
pub(super) struct Stored {
    /// Weights of voxel j in subset s are `starts[j * subsets + s] ..` the next.
    starts: Vec<u32>,
    weights: Vec<Weight>,
    subsets: usize,
}

impl Stored {
    pub(super) fn new(weights: &Weights, indices: &[u64], subsets: usize) -> Self {
        let made = |indices: &[u64]| -> Vec<(Vec<u32>, Vec<Weight>)> {
            let one = |merger: &mut Merger, index: &u64| {
                let mut ends = vec![0; subsets];
                let weights = merger.merged(weights, *index, &mut ends);
                (ends, weights)
            };
            indices.par_iter().with_min_len(64).map_init(|| Merger::new(weights), one).collect()
        };
        let mut stored = Self { starts: vec![0], weights: Vec::new(), subsets };
        for run in indices.chunks(RUN) {
            for (ends, weights) in made(run) {
                let base = stored.weights.len() as u32;
                stored.starts.extend(ends.iter().map(|end| base + end));
                stored.weights.extend(weights);
            }
        }
        stored
    }

    pub(super) fn retain(&mut self, held: &[bool]) {
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

    pub(super) fn count(&self) -> u64 {
        self.weights.len() as u64
    }

    /// The weights of a voxel.
    pub(super) fn of_voxel(&self, voxel: usize) -> &[Weight] {
        let n = voxel * self.subsets;
        &self.weights[self.starts[n] as usize..self.starts[n + self.subsets] as usize]
    }

    /// The weights of a voxel on a subset's rows.
    #[inline]
    pub(super) fn on_rows(&self, voxel: usize, rows: RowSet) -> &[Weight] {
        let n = voxel * self.subsets + rows.first as usize;
        &self.weights[self.starts[n] as usize..self.starts[n + 1] as usize]
    }
}

/// Adds up the weights of one voxel on each pixel, in a thread's buffers.
struct Merger {
    scratch: Scratch,
    /// Weight on each place; zero between voxels.
    sums: Vec<f32>,
    places: Vec<u32>,
}

impl Merger {
    fn new(weights: &Weights) -> Self {
        let [width, height] = weights.sensor_px();
        Self { scratch: Scratch::default(), sums: Plane::new(width, height).values, places: Vec::new() }
    }

    /// The weights of a voxel, each pixel once, by rising subset. `ends` becomes the end of each subset.
    fn merged(&mut self, weights: &Weights, index: u64, ends: &mut [u32]) -> Vec<Weight> {
        let stride = Plane::stride(weights.sensor_px()[0]);
        let subsets = ends.len();
        let subset = |place: u32| place as usize / stride % subsets;
        let (sums, places) = (&mut self.sums, &mut self.places);
        weights.runs(weights.grid().voxel(index), &mut self.scratch, RowSet::ALL, |row, first, share, columns| {
            let place = row * stride as u32 + first;
            for (place, weight) in (place..).zip(columns).filter(|(_, weight)| **weight > 0.0) {
                let sum = &mut sums[place as usize];
                if *sum == 0.0 {
                    places.push(place);
                }
                *sum += share * weight;
            }
        });
        // Sort by subset: count, then place.
        let mut next = vec![0u32; ends.len() + 1];
        places.iter().for_each(|place| next[subset(*place) + 1] += 1);
        for n in 1..next.len() {
            next[n] += next[n - 1];
        }
        ends.copy_from_slice(&next[1..]);
        let mut merged = vec![Weight { place: 0, weight: 0.0 }; places.len()];
        for place in places.drain(..) {
            let at = &mut next[subset(place)];
            merged[*at as usize] = Weight { place, weight: std::mem::take(&mut sums[place as usize]) };
            *at += 1;
        }
        merged
    }
}
