//! The inner loops for any machine, in four lanes: spread a strength onto image rows, gather from them.
//!
//! # Safety
//! For all unsafe functions: the start of every row, plus every stencil's column, plus 4, lies in the plane.

use super::stencils::{CutStencil, LitRow, Stencil};

/// Adds a voxel's light to rows of `plane`.
#[inline(always)]
pub(super) unsafe fn spread_whole(plane: &mut [f32], strength: f32, rows: &[LitRow], stencils: &[Stencil]) {
    for row in rows {
        let light = row.share * strength;
        for stencil in stencils {
            // SAFETY: as the caller says.
            unsafe { add(plane, row.start, stencil.columns, light, &stencil.shares) };
        }
    }
}

/// Like [`spread_whole`], but behind a round stop.
#[inline(always)]
pub(super) unsafe fn spread_cut(plane: &mut [f32], strength: f32, rows: &[LitRow], stencils: &[CutStencil]) {
    for row in rows {
        let light = row.share * strength;
        for stencil in stencils {
            // SAFETY: as the caller says.
            unsafe { add(plane, row.start, stencil.columns, light, &stencil.inside(row.chords.nodes)) };
        }
    }
}

/// A voxel's weighted sum over rows of `plane`, and the sum of the weights. `sum` is the sum of the stencils' shares.
#[inline(always)]
pub(super) unsafe fn gather_whole(plane: &[f32], rows: &[LitRow], stencils: &[Stencil], sum: f32) -> (f32, f32) {
    let (mut all, mut weight) = (0.0, 0.0);
    for row in rows {
        let mut lanes = [0f32; 4];
        for stencil in stencils {
            for half in 0..2 {
                // SAFETY: as the caller says.
                let values = unsafe { four(plane, row.start + stencil.columns[half] as usize) };
                for lane in 0..4 {
                    lanes[lane] += values[lane] * stencil.shares[4 * half + lane];
                }
            }
        }
        all += row.share * lanes.iter().sum::<f32>();
        weight += row.share * sum;
    }
    (all, weight)
}

/// Like [`gather_whole`], but behind a round stop.
#[inline(always)]
pub(super) unsafe fn gather_cut(plane: &[f32], rows: &[LitRow], stencils: &[CutStencil]) -> (f32, f32) {
    let (mut all, mut weight) = ([0f32; 8], [0f32; 8]);
    for row in rows {
        // SAFETY: as the caller says.
        unsafe { gather_row(plane, row, stencils, &mut all, &mut weight) };
    }
    (all.iter().sum(), weight.iter().sum())
}

/// Adds a row's shares inside the stop to `weight`, and the plane's values times these shares to `all`. Compiled on its
/// own: with the sums in memory all lanes work at once. Inlined, with the sums in registers, most of the work is done
/// lane by lane and takes three times as long.
#[inline(never)]
unsafe fn gather_row(plane: &[f32], row: &LitRow, stencils: &[CutStencil], all: &mut [f32; 8], weight: &mut [f32; 8]) {
    for stencil in stencils {
        let shares = stencil.inside(row.chords.nodes).map(|share| share * row.share);
        let [left, right] = stencil.columns;
        // SAFETY: as the caller says.
        let values = unsafe { [four(plane, row.start + left as usize), four(plane, row.start + right as usize)] };
        for (lane, value) in values.as_flattened().iter().enumerate() {
            all[lane] += value * shares[lane];
        }
        for lane in 0..8 {
            weight[lane] += shares[lane];
        }
    }
}

/// Adds shares of light at two runs of columns of a row. The runs may overlap.
#[inline(always)]
unsafe fn add(plane: &mut [f32], start: usize, columns: [u32; 2], light: f32, shares: &[f32; 8]) {
    for half in 0..2 {
        let from = start + columns[half] as usize;
        debug_assert!(from + 4 <= plane.len());
        // SAFETY: as the caller says; an array of four f32 needs the alignment of one.
        let out = unsafe { &mut *plane.as_mut_ptr().add(from).cast::<[f32; 4]>() };
        for lane in 0..4 {
            out[lane] += light * shares[4 * half + lane];
        }
    }
}

/// The four values from a place.
///
/// # Safety
/// `from + 4 <= values.len()`.
#[inline(always)]
unsafe fn four(values: &[f32], from: usize) -> [f32; 4] {
    debug_assert!(from + 4 <= values.len());
    // SAFETY: as the caller says; an array of four f32 needs the alignment of one.
    unsafe { *values.as_ptr().add(from).cast() }
}
