//! The loops of `kernel_portable.rs` in eight lanes, with fused operations.
//!
//! They hold no closure. A closure that is not inlined, as in a `map` of an array, made them ten times slower in builds
//! without link-time optimisation.
//!
//! # Safety
//! For all unsafe functions: the start of every row, plus every stencil's column, plus 4, lies in the plane. The
//! machine has AVX2 and FMA.

use super::stencils::{CutStencil, LitRow, Stencil};
use std::arch::x86_64::*;

/// A row's half chords, each in all lanes.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn nodes(row: &LitRow) -> [__m256; 3] {
    let [a, b, c] = row.chords.nodes;
    [_mm256_set1_ps(a), _mm256_set1_ps(b), _mm256_set1_ps(c)]
}

/// Loads eight lanes.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn eight(values: &[f32; 8]) -> __m256 {
    // SAFETY: an array of eight f32.
    unsafe { _mm256_loadu_ps(values.as_ptr()) }
}

/// The length of a half chord that lies in the parts of the aperture from `from`, `width` wide, mm.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn reach(half: __m256, from: __m256, width: __m256) -> __m256 {
    _mm256_max_ps(_mm256_min_ps(_mm256_sub_ps(half, from), width), _mm256_setzero_ps())
}

/// See [`CutStencil::inside`].
#[inline]
#[target_feature(enable = "avx2,fma")]
fn inside(stencil: &CutStencil, nodes: &[__m256; 3]) -> __m256 {
    let (from, width) = (eight(&stencil.from), eight(&stencil.width));
    let (a, b, c) = (reach(nodes[0], from, width), reach(nodes[1], from, width), reach(nodes[2], from, width));
    let ends = _mm256_mul_ps(_mm256_set1_ps(5.0), _mm256_add_ps(a, c));
    _mm256_mul_ps(eight(&stencil.density), _mm256_fmadd_ps(_mm256_set1_ps(8.0), b, ends))
}

/// Adds light at two runs of columns of a row.
#[inline]
#[target_feature(enable = "avx2,fma")]
unsafe fn add(row: *mut f32, columns: [u32; 2], light: __m256) {
    // SAFETY: as the caller says. The runs may overlap: the second is read after the first is written.
    unsafe {
        let (first, second) = (row.add(columns[0] as usize), row.add(columns[1] as usize));
        _mm_storeu_ps(first, _mm_add_ps(_mm_loadu_ps(first), _mm256_castps256_ps128(light)));
        _mm_storeu_ps(second, _mm_add_ps(_mm_loadu_ps(second), _mm256_extractf128_ps(light, 1)));
    }
}

/// The values at two runs of columns of a row.
#[inline]
#[target_feature(enable = "avx2,fma")]
unsafe fn values(row: *const f32, columns: [u32; 2]) -> __m256 {
    // SAFETY: as the caller says.
    unsafe {
        let (first, second) = (row.add(columns[0] as usize), row.add(columns[1] as usize));
        _mm256_set_m128(_mm_loadu_ps(second), _mm_loadu_ps(first))
    }
}

/// See `kernel_portable::spread_whole`.
#[target_feature(enable = "avx2,fma")]
pub(super) unsafe fn spread_whole(plane: &mut [f32], strength: f32, rows: &[LitRow], stencils: &[Stencil]) {
    for row in rows {
        let light = _mm256_set1_ps(row.share * strength);
        let out = plane.as_mut_ptr().wrapping_add(row.start);
        for stencil in stencils {
            // SAFETY: as the caller says.
            unsafe { add(out, stencil.columns, _mm256_mul_ps(light, eight(&stencil.shares))) };
        }
    }
}

/// See `kernel_portable::gather_whole`.
#[target_feature(enable = "avx2,fma")]
pub(super) unsafe fn gather_whole(plane: &[f32], rows: &[LitRow], stencils: &[Stencil], whole: f32) -> (f32, f32) {
    let (mut all, mut weight) = (_mm256_setzero_ps(), 0.0);
    for row in rows {
        let mut lanes = _mm256_setzero_ps();
        let from = plane.as_ptr().wrapping_add(row.start);
        for stencil in stencils {
            // SAFETY: as the caller says.
            let values = unsafe { values(from, stencil.columns) };
            lanes = _mm256_fmadd_ps(values, eight(&stencil.shares), lanes);
        }
        all = _mm256_fmadd_ps(_mm256_set1_ps(row.share), lanes, all);
        weight += row.share * whole;
    }
    (sum(all), weight)
}

/// See `kernel_portable::spread_cut`.
#[target_feature(enable = "avx2,fma")]
pub(super) unsafe fn spread_cut(plane: &mut [f32], strength: f32, rows: &[LitRow], stencils: &[CutStencil]) {
    for row in rows {
        let (nodes, light) = (nodes(row), _mm256_set1_ps(row.share * strength));
        let out = plane.as_mut_ptr().wrapping_add(row.start);
        for stencil in stencils {
            // SAFETY: as the caller says.
            unsafe { add(out, stencil.columns, _mm256_mul_ps(light, inside(stencil, &nodes))) };
        }
    }
}

/// See `kernel_portable::gather_cut`.
#[target_feature(enable = "avx2,fma")]
pub(super) unsafe fn gather_cut(plane: &[f32], rows: &[LitRow], stencils: &[CutStencil]) -> (f32, f32) {
    let (mut all, mut weight) = (_mm256_setzero_ps(), _mm256_setzero_ps());
    for row in rows {
        let (nodes, share) = (nodes(row), _mm256_set1_ps(row.share));
        let (mut lanes, mut cut) = (_mm256_setzero_ps(), _mm256_setzero_ps());
        let from = plane.as_ptr().wrapping_add(row.start);
        for stencil in stencils {
            let shares = inside(stencil, &nodes);
            // SAFETY: as the caller says.
            lanes = _mm256_fmadd_ps(unsafe { values(from, stencil.columns) }, shares, lanes);
            cut = _mm256_add_ps(cut, shares);
        }
        all = _mm256_fmadd_ps(share, lanes, all);
        weight = _mm256_fmadd_ps(share, cut, weight);
    }
    (sum(all), sum(weight))
}

/// The sum of all lanes.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn sum(lanes: __m256) -> f32 {
    let four = _mm_add_ps(_mm256_castps256_ps128(lanes), _mm256_extractf128_ps(lanes, 1));
    let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
    _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)))
}
