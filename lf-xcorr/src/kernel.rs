//! The products of a cell: sum over its midpoints x of first(x - d1) second(x + d2), for every trial shift d.
//!
//! Promise: about (lit voxels of the first volume in the cell) x (lit rows of the second within the search) x (shifts
//! along x, rounded up to whole vectors) multiplications. Every product is added in the order of the first volume's
//! voxels, whatever the instruction set: the sums of d between (A, B) and of -d between (B, A) are the same bytes.

use crate::shifts::{Shifts, back, on};
use crate::sparse::Rows;
use lf_core::simd::fastest;
use std::ops::Range;

/// Buffers kept from cell to cell; they need not be clean.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    /// The second volume's voxels around the cell, dense, rows padded for whole vectors.
    near: Vec<f64>,
    /// Which of those rows hold light.
    lit: Vec<bool>,
}

/// Adds the products of `cell` for every shift.
pub(crate) fn products(
    first: &Rows,
    second: &Rows,
    cell: &[Range<usize>; 3],
    shifts: &Shifts,
    out: &mut [f64],
    scratch: &mut Scratch,
) {
    fastest(
        #[inline(always)]
        || by_width(first, second, cell, shifts, out, scratch),
    );
}

#[inline(always)]
fn by_width(
    first: &Rows,
    second: &Rows,
    cell: &[Range<usize>; 3],
    shifts: &Shifts,
    out: &mut [f64],
    scratch: &mut Scratch,
) {
    match lanes_for(shifts.n[0]) {
        8 => lanes::<8>(first, second, cell, shifts, out, scratch),
        12 => lanes::<12>(first, second, cell, shifts, out, scratch),
        20 => lanes::<20>(first, second, cell, shifts, out, scratch),
        _ => lanes::<16>(first, second, cell, shifts, out, scratch),
    }
}

/// How many of `n` shifts along x are summed at a time.
pub(crate) fn lanes_for(n: usize) -> usize {
    match n {
        0..=8 => 8,
        9..=12 => 12,
        17..=20 => 20,
        _ => 16,
    }
}

/// Shifts along `axis` whose midpoint lies in the cell and whose second voxel in the volume, for the first voxel at `place`.
#[inline(always)]
fn reach(cell: &Range<usize>, length: usize, place: i32, shifts: &Shifts, axis: usize) -> Range<i32> {
    let (start, end) = (cell.start as i32, cell.end as i32);
    let low = shifts.low[axis].max(2 * (start - place)).max(-place);
    let high = shifts.high(axis).min(2 * (end - 1 - place) + 1).min(length as i32 - 1 - place);
    low..high + 1
}

#[inline(always)]
fn lanes<const L: usize>(
    first: &Rows,
    second: &Rows,
    cell: &[Range<usize>; 3],
    shifts: &Shifts,
    out: &mut [f64],
    scratch: &mut Scratch,
) {
    let shape = first.shape;
    let (start, end): ([i32; 3], [i32; 3]) =
        (cell.each_ref().map(|c| c.start as i32), cell.each_ref().map(|c| c.end as i32));
    let clip = |axis: usize, from: i32, to: i32| from.max(0)..to.min(shape[axis] as i32);
    let from_first = |a: usize| clip(a, start[a] - back(shifts.high(a)), end[a] - back(shifts.low[a]));
    let from_second = |a: usize| clip(a, start[a] + on(shifts.low[a]), end[a] + on(shifts.high(a)));
    let [ax, ay, az] = [0, 1, 2].map(from_first);
    let [_, by, bz] = [0, 1, 2].map(from_second);
    if [&ax, &ay, &az, &by, &bz].iter().any(|range| range.is_empty()) {
        return;
    }

    // Lay the second volume out densely; a row starts where the first column of the first volume meets the lowest shift.
    let chunks = shifts.n[0].div_ceil(L);
    let row_start = ax.start + shifts.low[0];
    let width = ax.len() + chunks * L;
    scratch.near.clear();
    scratch.near.resize(width * by.len() * bz.len(), 0.0);
    scratch.lit.clear();
    for z in bz.clone() {
        for y in by.clone() {
            let (x, value) = second.run(y as usize, z as usize, row_start, row_start + width as i32);
            let row = &mut scratch.near[scratch.lit.len() * width..][..width];
            x.iter().zip(value).for_each(|(&x, &value)| row[(x as i32 - row_start) as usize] = value as f64);
            scratch.lit.push(!x.is_empty());
        }
    }

    // Multiply every lit row of the first volume with every lit row of the second that a shift pairs with it.
    for z in az {
        for y in ay.clone() {
            let (x, value) = first.run(y as usize, z as usize, ax.start, ax.end);
            if x.is_empty() {
                continue;
            }
            // Voxels between `whole.start` and `whole.end` have their midpoint in the cell at every shift along x.
            let whole_from = x.partition_point(|&x| (x as i32) < start[0] - back(shifts.low[0]));
            let whole_to = x.partition_point(|&x| (x as i32) < end[0] - back(shifts.high(0))).max(whole_from);
            let line = Line { x, value, whole: whole_from..whole_to, from: ax.start, start: start[0], end: end[0] };
            for dz in reach(&cell[2], shape[2], z, shifts, 2) {
                for dy in reach(&cell[1], shape[1], y, shifts, 1) {
                    let row = (y + dy - by.start) as usize + by.len() * (z + dz - bz.start) as usize;
                    if !scratch.lit[row] {
                        continue;
                    }
                    let near = &scratch.near[row * width..][..width];
                    let place = shifts.place([0, (dy - shifts.low[1]) as usize, (dz - shifts.low[2]) as usize]);
                    let out = &mut out[place..place + shifts.n[0]];
                    for (chunk, out) in out.chunks_mut(L).enumerate() {
                        line.multiply::<L>(&near[chunk * L..], shifts.low[0] + (chunk * L) as i32, out);
                    }
                }
            }
        }
    }
}

/// One row of the first volume within reach of a cell.
struct Line<'a> {
    x: &'a [u32],
    value: &'a [f32],
    /// Places whose midpoint is in the cell at every shift.
    whole: Range<usize>,
    /// Column that the dense rows count from.
    from: i32,
    /// The cell's midpoints along x.
    start: i32,
    end: i32,
}

impl Line<'_> {
    /// Adds to `out[k]` the products with `near` at the shift `low + k` along x.
    #[inline(always)]
    fn multiply<const L: usize>(&self, near: &[f64], low: i32, out: &mut [f64]) {
        let mut sum = [0f64; L];
        for place in 0..self.whole.start {
            self.masked(place, near, low, &mut sum);
        }
        for place in self.whole.clone() {
            let value = self.value[place] as f64;
            let near = &near[(self.x[place] as i32 - self.from) as usize..][..L];
            for k in 0..L {
                sum[k] += value * near[k];
            }
        }
        for place in self.whole.end..self.x.len() {
            self.masked(place, near, low, &mut sum);
        }
        out.iter_mut().zip(&sum).for_each(|(out, sum)| *out += sum);
    }

    /// One voxel whose midpoint leaves the cell at some shifts.
    #[inline(always)]
    fn masked<const L: usize>(&self, place: usize, near: &[f64], low: i32, sum: &mut [f64; L]) {
        let x = self.x[place] as i32;
        let value = self.value[place] as f64;
        let near = &near[(x - self.from) as usize..][..L];
        let (from, to) = (2 * (self.start - x) - low, 2 * (self.end - x) - low);
        for k in 0..L {
            let inside = (k as i32) >= from && (k as i32) < to;
            sum[k] += if inside { value } else { 0.0 } * near[k];
        }
    }
}
