//! The weights of voxels in memory, a byte each.
//!
//! A voxel's weights are kept as multiples of a 255th of its greatest weight, four pixels of a row together. What is
//! rounded off changes a voxel's light by some 0.1 % in total variation; the sum of its weights stays exact.

use super::plane::{Plane, keep};
use super::row_buffer::{Four, LANES, RowBuffer};
use lf_core::Weights;
use lf_core::simd::fastest;
use lf_core::weights::{RowSet, Scratch};
use rayon::prelude::*;
use std::ops::Range;

/// Voxels whose weights are counted to estimate the number of all.
const SAMPLE: usize = 256;

/// Largest number of runs that are kept: they are counted in 32 bits, and the sample is off by a few per cent.
const MOST_RUNS: u64 = u32::MAX as u64 / 10 * 9;

/// Voxels that a thread takes at once, and how often all threads together do so before their lists are joined.
const VOXELS: usize = 1 << 8;
const BATCH: usize = 32;

/// Pixels of a row side by side, and the shares of a voxel's light on them.
#[derive(Debug, Clone, Copy)]
struct Run {
    /// From the first pixel of the run before to the first of this one, in [`pack`]ed rows. The first run of a voxel
    /// counts from the voxel's base.
    step: i16,
    /// In units of the voxel.
    shares: [u8; LANES],
}

const RUN_BYTES: u64 = size_of::<Run>() as u64;

/// 2^23, a float whose neighbours are 1 apart.
const WHOLE: f32 = 8_388_608.0;

/// Voxels at equal distances in the list, [`SAMPLE`] at most.
fn sample(indices: &[u64]) -> Vec<u64> {
    indices.iter().step_by(indices.len().div_ceil(SAMPLE).max(1)).copied().collect()
}

/// The count of all voxels, from the count of a sample.
fn of_all(count: usize, sample: &[u64], indices: &[u64]) -> u64 {
    (count as f64 / sample.len().max(1) as f64 * indices.len() as f64) as u64
}

/// The number of weights of all voxels, each pixel once, from a sample.
pub(crate) fn count_weights(weights: &Weights, indices: &[u64]) -> u64 {
    let sample = sample(indices);
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
    of_all(count, &sample, indices)
}

/// The weights of some voxels on the rows of one subset, voxel after voxel: they are read in this order.
#[derive(Debug, Clone, Default)]
struct Subset {
    /// Runs of each voxel end here.
    ends: Vec<u32>,
    /// The sum of each voxel's weights.
    sums: Vec<f32>,
    runs: Vec<Run>,
}

impl Subset {
    /// The runs of a voxel.
    #[inline(always)]
    fn of(&self, voxel: usize) -> &[Run] {
        let start = if voxel > 0 { self.ends[voxel - 1] } else { 0 };
        &self.runs[start as usize..self.ends[voxel] as usize]
    }

    /// Adds the voxels of `other` behind its own.
    fn extend(&mut self, other: &Self) {
        let base = self.runs.len() as u32;
        self.ends.extend(other.ends.iter().map(|end| base + end));
        self.sums.extend(&other.sums);
        self.runs.extend(&other.runs);
    }

    fn retain(&mut self, held: &[bool]) {
        let (mut start, mut voxels, mut end) = (0, 0, 0);
        for (voxel, held) in held.iter().enumerate() {
            let runs = start..self.ends[voxel] as usize;
            start = runs.end;
            if *held {
                let count = runs.len();
                self.runs.copy_within(runs, end);
                end += count;
                (self.ends[voxels], self.sums[voxels]) = (end as u32, self.sums[voxel]);
                voxels += 1;
            }
        }
        self.runs.truncate(end);
        self.ends.truncate(voxels);
        self.sums.truncate(voxels);
    }
}

/// The weights of some voxels.
struct Part {
    subsets: Vec<Subset>,
    /// Each voxel's unit of light.
    units: Vec<f32>,
    /// A place in [`pack`]ed rows near the voxel's runs, for each voxel.
    bases: Vec<u32>,
    /// A buffer: the last place of the voxel in each subset.
    last: Vec<u32>,
}

impl Part {
    fn new(subsets: usize) -> Self {
        let subsets = vec![Subset::default(); subsets];
        Self { last: vec![0; subsets.len()], subsets, units: Vec::new(), bases: Vec::new() }
    }

    /// Adds a voxel.
    #[inline(always)]
    fn add(&mut self, listed: &[Four], stride: u32) {
        // Find the voxel's light and its greatest weight, which is 255 units.
        let (mut light, mut most) = ([0f32; LANES], [0f32; LANES]);
        for four in listed {
            for n in 0..LANES {
                light[n] += four.shares[n];
                most[n] = most[n].max(four.shares[n]);
            }
        }
        let light: f32 = light.iter().sum();
        let per_unit = 255.0 / most.iter().fold(f32::MIN_POSITIVE, |most, share| most.max(*share));
        let count = self.subsets.len() as u32;
        // Sums stand here as multiples of the unit, which is not known before the end.
        self.subsets.iter_mut().for_each(|subset| subset.sums.push(0.0));
        let voxel = self.units.len();
        let base = listed.first().map_or(0, |four| four.place / stride / count * stride + four.place % stride);
        self.bases.push(base);
        self.last.fill(base);
        // Round each four to units and append it to the runs of its row's subset.
        let (mut start, mut packed, mut subset) = (0, 0, 0);
        for Four { place, shares } in listed {
            if !(start..start + stride).contains(place) {
                let row = place / stride;
                (start, packed, subset) = (row * stride, row / count * stride, (row % count) as usize);
            }
            // Adding a whole number of this size leaves the rounded value in the lowest bits.
            let whole = shares.map(|share| (share * per_unit + WHOLE).to_bits() & 255);
            let last = &mut self.last[subset];
            let subset = &mut self.subsets[subset];
            subset.sums[voxel] += whole.iter().sum::<u32>() as f32;
            let place = packed + place - start;
            let step = step_to(place, last, &mut subset.runs);
            subset.runs.push(Run { step, shares: whole.map(|share| share as u8) });
        }
        // Choose the unit so that the rounded weights have the voxel's light.
        let all: f32 = self.subsets.iter().map(|subset| subset.sums[voxel]).sum();
        let unit = light / all.max(1.0);
        for subset in &mut self.subsets {
            subset.sums[voxel] *= unit;
            subset.ends.push(subset.runs.len() as u32);
        }
        self.units.push(unit);
    }
}

/// The step from the last place to this one, which becomes the last. Runs without light make the way of a longer one.
#[inline(always)]
fn step_to(place: u32, last: &mut u32, runs: &mut Vec<Run>) -> i16 {
    let mut way = i64::from(place) - i64::from(*last);
    *last = place;
    while i16::try_from(way).is_err() {
        let step = if way > 0 { i16::MAX } else { i16::MIN };
        runs.push(Run { step, shares: [0; LANES] });
        way -= i64::from(step);
    }
    way as i16
}

/// The rows of a subset, one after the other.
pub(super) fn pack(plane: &Plane, rows: RowSet) -> Vec<f32> {
    rows_of(&plane.values, plane.stride, rows).flatten().copied().collect()
}

/// Each row of a subset.
fn rows_of(values: &[f32], stride: usize, rows: RowSet) -> impl Iterator<Item = &[f32]> {
    values.chunks(stride).skip(rows.first as usize).step_by(rows.step as usize)
}

/// The weights of voxels on the rows of each subset of an image's.
pub(super) struct Stored(Part);

impl Stored {
    /// Estimates the bytes of [`Stored::new`] from a sample of the voxels.
    pub(super) fn estimated_bytes(weights: &Weights, indices: &[u64], subsets: usize) -> u64 {
        let sample = sample(indices);
        let count = |row_buffer: &mut RowBuffer, index: &u64| row_buffer.list(weights, *index).len();
        let count: usize = sample.par_iter().map_init(|| RowBuffer::new(weights), count).sum();
        let runs = of_all(count, &sample, indices);
        runs * RUN_BYTES + indices.len() as u64 * (8 + 8 * subsets as u64)
    }

    /// Whether weights that take `bytes` may be kept.
    pub(super) fn fits(bytes: u64, most_bytes: u64) -> bool {
        bytes <= most_bytes.min(MOST_RUNS * RUN_BYTES)
    }

    /// Upper limit of the bytes of the lists that [`Stored::new`] joins.
    pub(super) fn lists_bytes(bytes: u64, voxels: usize) -> u64 {
        bytes / (voxels as u64).max(1) * (voxels.min(VOXELS * BATCH) as u64)
    }

    /// Makes and keeps the weights of the voxels. `estimated` is their size, bytes, by [`Stored::estimated_bytes`].
    pub(super) fn new(weights: &Weights, indices: &[u64], subsets: usize, estimated: u64) -> Self {
        let stride = Plane::stride(weights.sensor_px()[0]) as u32;
        let made = |row_buffer: &mut RowBuffer, indices: &[u64]| {
            let mut part = Part::new(subsets);
            fastest(
                #[inline(always)]
                || {
                    for index in indices {
                        part.add(row_buffer.list(weights, *index), stride);
                    }
                },
            );
            part
        };
        // Make the weights batch by batch, so that the lists to be joined stay small.
        let mut all = Part::new(subsets);
        let runs = (estimated / RUN_BYTES) as usize;
        all.subsets.iter_mut().for_each(|subset| subset.runs.reserve(runs / subsets));
        for batch in indices.chunks(VOXELS * BATCH) {
            let parts: Vec<Part> = batch
                .par_chunks(VOXELS)
                .map_init(|| RowBuffer::new(weights), |row_buffer, indices| made(row_buffer, indices))
                .collect();
            let joined = all.subsets.par_iter_mut().enumerate();
            joined.for_each(|(n, subset)| parts.iter().for_each(|part| subset.extend(&part.subsets[n])));
            parts.iter().for_each(|part| {
                all.units.extend(&part.units);
                all.bases.extend(&part.bases);
            });
        }
        Self(all)
    }

    pub(super) fn retain(&mut self, held: &[bool]) {
        self.0.subsets.par_iter_mut().for_each(|subset| subset.retain(held));
        keep(&mut self.0.units, held);
        keep(&mut self.0.bases, held);
    }

    /// The number of weights, those of 0 beside others too.
    pub(super) fn count(&self) -> u64 {
        self.0.subsets.iter().map(|subset| LANES * subset.runs.len()).sum::<usize>() as u64
    }

    /// The sum of a voxel's weights.
    pub(super) fn share(&self, voxel: usize) -> f32 {
        self.0.subsets.iter().map(|subset| subset.sums[voxel]).sum()
    }

    /// Adds the light of voxels of these strengths to the pixels of a subset's rows, which stand [`pack`]ed.
    #[inline(always)]
    pub(super) fn add(&self, voxels: Range<usize>, rows: RowSet, strengths: &[f32], values: &mut [f32]) {
        let subset = &self.0.subsets[rows.first as usize];
        for voxel in voxels {
            let light = strengths[voxel] * self.0.units[voxel];
            let mut place = self.0.bases[voxel];
            for run in subset.of(voxel) {
                place = place.wrapping_add_signed(run.step.into());
                let values = &mut values[place as usize..][..LANES];
                let shares = run.shares.map(f32::from);
                (0..LANES).for_each(|n| values[n] += light * shares[n]);
            }
        }
    }

    /// The sums, over the pixels of a subset's [`pack`]ed rows, of a voxel's weights times the values and of the
    /// weights.
    #[inline(always)]
    pub(super) fn seen(&self, voxel: usize, rows: RowSet, values: &[f32]) -> (f32, f32) {
        let subset = &self.0.subsets[rows.first as usize];
        let mut sums = [0f32; LANES];
        let mut place = self.0.bases[voxel];
        for run in subset.of(voxel) {
            place = place.wrapping_add_signed(run.step.into());
            let values = &values[place as usize..][..LANES];
            let shares = run.shares.map(f32::from);
            (0..LANES).for_each(|n| sums[n] += shares[n] * values[n]);
        }
        let [a, b, c, d] = sums;
        let sum = (a + b) + (c + d);
        (self.0.units[voxel] * sum, subset.sums[voxel])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps forth and back, near ones and ones that no 16 bits hold, lead to every place.
    #[test]
    fn steps_lead_to_every_place() {
        let places = [70_000, 70_004, 69_000, 102_767, 102_768, 135_536, 3, 200_000, 199_999, 0, u32::MAX - 4];
        let (mut last, mut runs, mut ends) = (places[0], Vec::new(), Vec::new());
        for place in places {
            let step = step_to(place, &mut last, &mut runs);
            runs.push(Run { step, shares: [1; LANES] });
            ends.push(runs.len());
        }
        let mut place = places[0];
        let mut found = Vec::new();
        for run in &runs {
            place = place.wrapping_add_signed(run.step.into());
            if run.shares != [0; LANES] {
                found.push(place);
            }
        }
        assert_eq!(found, places);
        assert!(runs.len() > places.len(), "some steps need more runs");
        assert_eq!(ends[..4], [1, 2, 3, 5], "33,767 is a step too long");
    }
}
