//! The loops of [`crate::kernel`] in eight lanes, with fused operations. No closure stands in them: left a call of its own,
//! as that of a `map` of an array may be, it made them ten times slower in builds without link-time optimisation.

use crate::kernel::{CutTap, Line, Tap};
use std::arch::x86_64::*;

/// A line's half chords, each in all lanes.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn nodes(line: &Line) -> [__m256; 3] {
    let [a, b, c] = line.chords.nodes;
    [_mm256_set1_ps(a), _mm256_set1_ps(b), _mm256_set1_ps(c)]
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn eight(values: &[f32; 8]) -> __m256 {
    // SAFETY: an array of eight f32.
    unsafe { _mm256_loadu_ps(values.as_ptr()) }
}

/// How much of a half chord lies in parts of the aperture that begin at `from` and are `width` wide, mm.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn reach(half: __m256, from: __m256, width: __m256) -> __m256 {
    _mm256_max_ps(_mm256_min_ps(_mm256_sub_ps(half, from), width), _mm256_setzero_ps())
}

/// [`CutTap::inside`].
#[inline]
#[target_feature(enable = "avx2,fma")]
fn inside(tap: &CutTap, nodes: &[__m256; 3]) -> __m256 {
    let (from, width) = (eight(&tap.from), eight(&tap.width));
    let (a, b, c) = (reach(nodes[0], from, width), reach(nodes[1], from, width), reach(nodes[2], from, width));
    let ends = _mm256_mul_ps(_mm256_set1_ps(5.0), _mm256_add_ps(a, c));
    _mm256_mul_ps(eight(&tap.density), _mm256_fmadd_ps(_mm256_set1_ps(8.0), b, ends))
}

/// # Safety
/// As for [`crate::kernel::add`].
#[inline]
#[target_feature(enable = "avx2,fma")]
unsafe fn add(line: *mut f32, columns: [u32; 2], light: __m256) {
    // SAFETY: as the caller says. The runs may overlap: the second is read when the first is written.
    unsafe {
        let (first, second) = (line.add(columns[0] as usize), line.add(columns[1] as usize));
        _mm_storeu_ps(first, _mm_add_ps(_mm_loadu_ps(first), _mm256_castps256_ps128(light)));
        _mm_storeu_ps(second, _mm_add_ps(_mm_loadu_ps(second), _mm256_extractf128_ps(light, 1)));
    }
}

/// # Safety
/// As for [`crate::kernel::four`], for both columns.
#[inline]
#[target_feature(enable = "avx2,fma")]
unsafe fn values(line: *const f32, columns: [u32; 2]) -> __m256 {
    // SAFETY: as the caller says.
    unsafe {
        let (first, second) = (line.add(columns[0] as usize), line.add(columns[1] as usize));
        _mm256_set_m128(_mm_loadu_ps(second), _mm_loadu_ps(first))
    }
}

/// # Safety
/// As for [`crate::kernel::spread`].
#[target_feature(enable = "avx2,fma")]
pub(crate) unsafe fn spread_whole(plane: &mut [f32], strength: f32, lines: &[Line], taps: &[Tap]) {
    for line in lines {
        let light = _mm256_set1_ps(line.share * strength);
        let out = plane.as_mut_ptr().wrapping_add(line.start);
        for tap in taps {
            // SAFETY: as the caller says.
            unsafe { add(out, tap.columns, _mm256_mul_ps(light, eight(&tap.shares))) };
        }
    }
}

/// # Safety
/// As for [`crate::kernel::spread`].
#[target_feature(enable = "avx2,fma")]
pub(crate) unsafe fn gather_whole(plane: &[f32], lines: &[Line], taps: &[Tap], whole: f32) -> (f32, f32) {
    let (mut all, mut weight) = (_mm256_setzero_ps(), 0.0);
    for line in lines {
        let mut part = _mm256_setzero_ps();
        let from = plane.as_ptr().wrapping_add(line.start);
        for tap in taps {
            // SAFETY: as the caller says.
            let values = unsafe { values(from, tap.columns) };
            part = _mm256_fmadd_ps(values, eight(&tap.shares), part);
        }
        all = _mm256_fmadd_ps(_mm256_set1_ps(line.share), part, all);
        weight += line.share * whole;
    }
    (sum(all), weight)
}

/// # Safety
/// As for [`crate::kernel::spread`].
#[target_feature(enable = "avx2,fma")]
pub(crate) unsafe fn spread_cut(plane: &mut [f32], strength: f32, lines: &[Line], taps: &[CutTap]) {
    for line in lines {
        let (nodes, light) = (nodes(line), _mm256_set1_ps(line.share * strength));
        let out = plane.as_mut_ptr().wrapping_add(line.start);
        for tap in taps {
            // SAFETY: as the caller says.
            unsafe { add(out, tap.columns, _mm256_mul_ps(light, inside(tap, &nodes))) };
        }
    }
}

/// # Safety
/// As for [`crate::kernel::spread`].
#[target_feature(enable = "avx2,fma")]
pub(crate) unsafe fn gather_cut(plane: &[f32], lines: &[Line], taps: &[CutTap]) -> (f32, f32) {
    let (mut all, mut weight) = (_mm256_setzero_ps(), _mm256_setzero_ps());
    for line in lines {
        let (nodes, share) = (nodes(line), _mm256_set1_ps(line.share));
        let (mut part, mut cut) = (_mm256_setzero_ps(), _mm256_setzero_ps());
        let from = plane.as_ptr().wrapping_add(line.start);
        for tap in taps {
            let shares = inside(tap, &nodes);
            // SAFETY: as the caller says.
            part = _mm256_fmadd_ps(unsafe { values(from, tap.columns) }, shares, part);
            cut = _mm256_add_ps(cut, shares);
        }
        all = _mm256_fmadd_ps(share, part, all);
        weight = _mm256_fmadd_ps(share, cut, weight);
    }
    (sum(all), sum(weight))
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn sum(lanes: __m256) -> f32 {
    let four = _mm_add_ps(_mm256_castps256_ps128(lanes), _mm256_extractf128_ps(lanes, 1));
    let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
    _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)))
}
