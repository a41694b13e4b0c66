//! The products of a cell: the sum over its midpoints x of first(x - d1) second(x + d2), for every trial shift d.
//!
//! Cost: about (lit voxels of the first volume in the cell) x (lit rows of the second within the search) x (shifts
//! along x, rounded up to whole vectors) multiplications. Promise: products are added in the order of the first
//! volume's voxels at every vector width. The sums of d between (A, B) and of -d between (B, A) are the same bytes.

use super::shifts::{Shifts, back, on};
use super::sums::zeros;
use crate::volumes::Rows;
use lf_core::simd::fastest;
use std::ops::Range;

/// Buffers reused from cell to cell; their contents do not matter.
#[derive(Debug, Default)]
pub(crate) struct ProductScratch {
    /// The second volume's voxels around the cell as a dense box; rows are padded to whole vectors.
    dense: Vec<f64>,
    /// Whether a row of `dense` holds light.
    is_lit: Vec<bool>,
}

/// Two volumes, a cell of midpoints, and the trial shifts.
#[derive(Clone, Copy)]
pub(crate) struct CellProducts<'a> {
    pub first: &'a Rows,
    pub second: &'a Rows,
    pub midpoints: &'a [Range<usize>; 3],
    pub shifts: &'a Shifts,
}

/// Adds the products of a cell for every shift.
pub(crate) fn products(cell: CellProducts, out: &mut [f64], scratch: &mut ProductScratch) {
    fastest(
        #[inline(always)]
        || match lanes_for(cell.shifts.n[0]) {
            8 => cell.add::<8>(out, scratch),
            12 => cell.add::<12>(out, scratch),
            20 => cell.add::<20>(out, scratch),
            _ => cell.add::<16>(out, scratch),
        },
    );
}

/// Number of shifts along x that are summed at a time, of `n`.
pub(crate) fn lanes_for(n: usize) -> usize {
    match n {
        0..=8 => 8,
        9..=12 => 12,
        17..=20 => 20,
        _ => 16,
    }
}

impl CellProducts<'_> {
    /// Voxels of the first volume along `axis` that any shift pairs with a midpoint of the cell.
    #[inline(always)]
    fn of_first(&self, axis: usize) -> Range<i32> {
        let (cell, shifts) = (&self.midpoints[axis], self.shifts);
        self.clipped(axis, cell.start as i32 - back(shifts.high(axis)), cell.end as i32 - back(shifts.low[axis]))
    }

    /// Voxels of the second volume along `axis` that any shift pairs with a midpoint of the cell.
    #[inline(always)]
    fn of_second(&self, axis: usize) -> Range<i32> {
        let (cell, shifts) = (&self.midpoints[axis], self.shifts);
        self.clipped(axis, cell.start as i32 + on(shifts.low[axis]), cell.end as i32 + on(shifts.high(axis)))
    }

    #[inline(always)]
    fn clipped(&self, axis: usize, from: i32, to: i32) -> Range<i32> {
        from.max(0)..to.min(self.first.shape[axis] as i32)
    }

    /// Shifts along `axis` at which voxel `place` of the first volume has its midpoint in the cell and its partner in
    /// the second volume.
    #[inline(always)]
    fn shifts_of(&self, axis: usize, place: i32) -> Range<i32> {
        let (start, end) = (self.midpoints[axis].start as i32, self.midpoints[axis].end as i32);
        let low = self.shifts.low[axis].max(2 * (start - place)).max(-place);
        let high = self.shifts.high(axis).min(2 * (end - 1 - place) + 1);
        low..high.min(self.first.shape[axis] as i32 - 1 - place) + 1
    }

    /// Adds the products, `L` shifts along x at a time.
    #[inline(always)]
    fn add<const L: usize>(&self, out: &mut [f64], scratch: &mut ProductScratch) {
        let [ax, ay, az] = [0, 1, 2].map(|axis| self.of_first(axis));
        let [by, bz] = [1, 2].map(|axis| self.of_second(axis));
        if [&ax, &ay, &az, &by, &bz].iter().any(|range| range.is_empty()) {
            return;
        }
        let shifts = self.shifts;
        let width = ax.len() + shifts.n[0].div_ceil(L) * L;
        self.fill_dense(ax.start + shifts.low[0], width, [&by, &bz], scratch);

        // Multiply every lit row of the first volume with every lit row of the second that a shift pairs with it.
        for z in az {
            for y in ay.clone() {
                let Some(row) = self.first_row(y, z, &ax) else { continue };
                for dz in self.shifts_of(2, z) {
                    for dy in self.shifts_of(1, y) {
                        let partner = (y + dy - by.start) as usize + by.len() * (z + dz - bz.start) as usize;
                        if !scratch.is_lit[partner] {
                            continue;
                        }
                        let dense = &scratch.dense[partner * width..][..width];
                        let place = shifts.index([0, (dy - shifts.low[1]) as usize, (dz - shifts.low[2]) as usize]);
                        let out = &mut out[place..place + shifts.n[0]];
                        for (chunk, out) in out.chunks_mut(L).enumerate() {
                            row.multiply::<L>(&dense[chunk * L..], shifts.low[0] + (chunk * L) as i32, out);
                        }
                    }
                }
            }
        }
    }

    /// Writes the second volume as a dense box, in rows of `width` voxels from `start` on: the column that the lowest
    /// shift pairs with the first column of the first volume.
    #[inline(always)]
    fn fill_dense(&self, start: i32, width: usize, [by, bz]: [&Range<i32>; 2], scratch: &mut ProductScratch) {
        zeros(&mut scratch.dense, width * by.len() * bz.len());
        scratch.is_lit.clear();
        for z in bz.clone() {
            for y in by.clone() {
                let (x, value) = self.second.run(y as usize, z as usize, start, start + width as i32);
                let row = &mut scratch.dense[scratch.is_lit.len() * width..][..width];
                x.iter().zip(value).for_each(|(&x, &value)| row[(x as i32 - start) as usize] = value as f64);
                scratch.is_lit.push(!x.is_empty());
            }
        }
    }

    /// The lit voxels of row (y, z) of the first volume; `None` if the row is dark.
    #[inline(always)]
    fn first_row(&self, y: i32, z: i32, ax: &Range<i32>) -> Option<FirstRow<'_>> {
        let (x, value) = self.first.run(y as usize, z as usize, ax.start, ax.end);
        if x.is_empty() {
            return None;
        }
        let (start, end) = (self.midpoints[0].start as i32, self.midpoints[0].end as i32);
        let from = x.partition_point(|&x| (x as i32) < start - back(self.shifts.low[0]));
        let to = x.partition_point(|&x| (x as i32) < end - back(self.shifts.high(0))).max(from);
        Some(FirstRow { x, value, whole: from..to, origin: ax.start, start, end })
    }
}

/// The lit voxels of a row of the first volume that shifts pair with midpoints of a cell.
struct FirstRow<'a> {
    x: &'a [u32],
    value: &'a [f32],
    /// Entries whose midpoint is in the cell at every shift along x.
    whole: Range<usize>,
    /// The x that the dense rows count from.
    origin: i32,
    /// First midpoint of the cell along x, and the one after its last.
    start: i32,
    end: i32,
}

impl FirstRow<'_> {
    /// Adds to `out[k]` the products with `dense` at the shift `low + k` along x.
    #[inline(always)]
    fn multiply<const L: usize>(&self, dense: &[f64], low: i32, out: &mut [f64]) {
        let mut sum = [0f64; L];
        for entry in 0..self.whole.start {
            self.masked(entry, dense, low, &mut sum);
        }
        for entry in self.whole.clone() {
            let value = self.value[entry] as f64;
            let dense = &dense[(self.x[entry] as i32 - self.origin) as usize..][..L];
            for k in 0..L {
                sum[k] += value * dense[k];
            }
        }
        for entry in self.whole.end..self.x.len() {
            self.masked(entry, dense, low, &mut sum);
        }
        out.iter_mut().zip(&sum).for_each(|(out, sum)| *out += sum);
    }

    /// Adds a voxel whose midpoint is outside the cell at some shifts.
    #[inline(always)]
    fn masked<const L: usize>(&self, entry: usize, dense: &[f64], low: i32, sum: &mut [f64; L]) {
        let x = self.x[entry] as i32;
        let value = self.value[entry] as f64;
        let dense = &dense[(x - self.origin) as usize..][..L];
        let (from, to) = (2 * (self.start - x) - low, 2 * (self.end - x) - low);
        for k in 0..L {
            let is_inside = (k as i32) >= from && (k as i32) < to;
            sum[k] += if is_inside { value } else { 0.0 } * dense[k];
        }
    }
}
