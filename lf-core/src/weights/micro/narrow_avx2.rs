//! [`super::narrow`] with AVX2: eight lenslets at once.

use super::array::LANES;
use super::bend::TERMS;
use super::hits::{FULL, HitList, Hits};
use super::narrow::Narrow;
use super::patches::ACROSS;
use std::arch::x86_64::*;

/// For each subset of eight lanes, its lanes in order: moves them to the front.
static FRONT: [[i32; LANES]; 256] = {
    let mut table = [[0; LANES]; 256];
    let mut set = 0;
    while set < 256 {
        let (mut lane, mut next) = (0, 0);
        while lane < LANES {
            if set >> lane & 1 == 1 {
                table[set][next] = lane as i32;
                next += 1;
            }
            lane += 1;
        }
        set += 1;
    }
    table
};

/// Eight values.
#[inline]
#[target_feature(enable = "avx2")]
fn load(values: &[f32], first: usize) -> __m256 {
    // SAFETY: eight values there are.
    unsafe { _mm256_loadu_ps(values[first..first + LANES].as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn load_whole(values: &[i32], first: usize) -> __m256i {
    // SAFETY: eight values there are.
    unsafe { _mm256_loadu_si256(values[first..first + LANES].as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn store(values: __m256, out: &mut [f32], first: usize) {
    // SAFETY: eight places there are.
    unsafe { _mm256_storeu_ps(out[first..first + LANES].as_mut_ptr(), values) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn store_whole(values: __m256i, out: &mut [i32], first: usize) {
    // SAFETY: eight places there are.
    unsafe { _mm256_storeu_si256(out[first..first + LANES].as_mut_ptr().cast(), values) }
}

/// [`super::bend::value`] of eight places.
#[inline]
#[target_feature(enable = "avx2")]
fn value(terms: &[f32; TERMS], x: __m256, y: __m256) -> __m256 {
    use {_mm256_add_ps as plus, _mm256_mul_ps as times};
    let [a, b, c, d, e, f, g, h, i] = terms.map(|term| _mm256_set1_ps(term));
    let square = plus(plus(c, times(x, f)), times(y, g));
    let mixed = plus(d, times(y, h));
    let along_x = plus(plus(a, times(x, square)), times(y, mixed));
    let along_y = plus(b, times(y, plus(e, times(y, i))));
    plus(times(x, along_x), times(y, along_y))
}

/// The light of a voxel under eight lenslets.
struct Eight {
    /// Where the rays through the centres pass the stop, mm; and the square of the distance from its middle.
    u: __m256,
    v: __m256,
    far2: __m256,
    /// The patch's first column and row on the micro-image, in phases.
    across: __m256,
    down: __m256i,
}

/// Rows of patches on the wanted rows.
struct Rows {
    /// The row of the patch, and of the micro-image; all ones in lanes of a slot after the first.
    patch_row: __m256i,
    line: __m256i,
    later: __m256i,
}

impl Narrow<'_> {
    /// Does what [`Narrow::eight_portable`] does, for eight lenslets at once.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn eight_avx2<const WEIGHS: bool>(
        &self,
        row: usize,
        number: usize,
        end: usize,
        slot: Option<usize>,
        (voxel, x0, y0): (usize, f32, f32),
        hits: &mut Hits,
    ) {
        let Self { array, patches, wanted, .. } = *self;
        let whole = |value: i32| _mm256_set1_epi32(value);
        let first = row * array.length + number;
        // Find the places of the patches, in pixels and phases, and the rows that fall on the wanted row.
        let eight = self.places(first, x0, y0);
        let bits = _mm_cvtsi32_si128(patches.bits as i32);
        let across = below(eight.across);
        let parts = _mm256_sub_ps(eight.across, _mm256_cvtepi32_ps(across));
        let column = _mm256_sra_epi32(across, _mm_cvtsi32_si128(ACROSS.ilog2() as i32));
        let rows = self.rows(first, slot, _mm256_sra_epi32(eight.down, bits));
        // Select the lanes that have light there, and those that the stop may cut.
        let lanes = (1u32 << (end - number).min(LANES)) - 1;
        let valid = self.valid(&eight, &rows, column) & lanes;
        let cut = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(eight.far2, _mm256_set1_ps(self.whole2))) as u32;
        // Compute the offsets in the table of patches.
        let phase = _mm256_and_si256(eight.down, whole((1 << patches.bits) - 1));
        let phase = match patches.classes {
            1 => phase,
            _ => _mm256_or_si256(_mm256_sll_epi32(self.classes(first, &eight), bits), phase),
        };
        let lines = _mm256_add_epi32(_mm256_mullo_epi32(phase, whole(patches.rows as i32)), rows.patch_row);
        let shares = _mm256_mullo_epi32(lines, whole(ACROSS as i32 + 1));
        let shares = _mm256_add_epi32(shares, _mm256_and_si256(across, whole(ACROSS as i32 - 1)));
        let shares = _mm256_mullo_epi32(shares, whole(patches.columns as i32));
        // Compute the offsets in the micro-images.
        let place = wanted.layout.place(row - wanted.lenslets.start, number, 0) as i32;
        let images = _mm256_mullo_epi32(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), whole(wanted.layout.image as i32));
        let values = _mm256_add_epi32(images, _mm256_add_epi32(whole(place), column));
        let slots = whole((slot.unwrap_or(1) * wanted.layout.slot()) as i32);
        let values = _mm256_add_epi32(values, _mm256_and_si256(rows.later, slots));
        // Append the selected lanes to the lists.
        let at = hits.all.count;
        assert!(at <= FULL && hits.cut.count <= at);
        let add = |list: &mut HitList, set: u32| {
            let (at, order) = (list.count, load_whole(&FRONT[set as usize & 255], 0));
            let moved = |values: __m256i| _mm256_permutevar8x32_epi32(values, order);
            store_whole(whole(voxel as i32), &mut list.voxels, at);
            store_whole(moved(shares), &mut list.shares, at);
            store_whole(moved(values), &mut list.values, at);
            store(_mm256_permutevar8x32_ps(parts, order), &mut list.parts, at);
            if patches.columns > 8 {
                store_whole(moved(column), &mut list.columns, at);
            }
            list.count += set.count_ones() as usize;
        };
        add(&mut hits.all, valid);
        add(&mut hits.cut, valid & cut);
        if WEIGHS {
            let order = load_whole(&FRONT[valid as usize & 255], 0);
            store_whole(_mm256_permutevar8x32_epi32(lines, order), &mut hits.lines, at);
            store(_mm256_permutevar8x32_ps(self.inside(eight.far2), order), &mut hits.inside, at);
        }
    }

    /// The places of the light.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn places(&self, first: usize, x0: f32, y0: f32) -> Eight {
        let Self { array, slice, patches, stop, .. } = *self;
        let all = |value: f32| _mm256_set1_ps(value);
        let per_alpha = all(slice.per_alpha);
        let across_mm = _mm256_sub_ps(load(&array.x, first), all(x0));
        let down_mm = _mm256_sub_ps(load(&array.y, first), all(y0));
        let (u, v) = match self.node {
            None => (_mm256_mul_ps(across_mm, per_alpha), _mm256_mul_ps(down_mm, per_alpha)),
            Some(node) => {
                let near = node.inverse.each_ref().map(|terms| value(terms, across_mm, down_mm));
                let bend = node.departure.each_ref().map(|terms| value(terms, near[0], near[1]));
                // See `Node::aperture`.
                let refined = |mm: __m256, near: __m256, bend: __m256| {
                    let hit = _mm256_add_ps(_mm256_mul_ps(all(slice.alpha), near), bend);
                    _mm256_add_ps(near, _mm256_mul_ps(per_alpha, _mm256_sub_ps(mm, hit)))
                };
                (refined(across_mm, near[0], bend[0]), refined(down_mm, near[1], bend[1]))
            }
        };
        let scale = load(&array.per_mm, first);
        let x = _mm256_sub_ps(load(&array.middle_x, first), _mm256_mul_ps(scale, u));
        let y = _mm256_sub_ps(load(&array.middle_y, first), _mm256_mul_ps(scale, v));
        let (u2, v2) = (_mm256_mul_ps(u, u), _mm256_mul_ps(v, v));
        let far2 = if stop.is_round { _mm256_add_ps(u2, v2) } else { _mm256_max_ps(u2, v2) };
        let phases =
            |place: __m256, per_px: f32| _mm256_mul_ps(_mm256_sub_ps(place, all(patches.half_px)), all(per_px));
        Eight { u, v, far2, across: phases(x, ACROSS as f32), down: below(phases(y, patches.per_px)) }
    }

    /// The wanted rows of patches that begin at image row `top` of their micro-images.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn rows(&self, first: usize, slot: Option<usize>, top: __m256i) -> Rows {
        let wanted = self.wanted;
        let whole = |value: i32| _mm256_set1_epi32(value);
        let step = whole(wanted.rows.step as i32);
        let ahead = _mm256_sub_epi32(whole(wanted.rows.first as i32), load_whole(wanted.remainders, first));
        let ahead = _mm256_add_epi32(ahead, _mm256_and_si256(step, _mm256_cmpgt_epi32(whole(0), ahead)));
        let later = match slot {
            None => _mm256_cmpgt_epi32(top, ahead),
            Some(slot) => whole(if slot > 0 { -1 } else { 0 }),
        };
        let steps = _mm256_mullo_epi32(step, whole(slot.unwrap_or(1) as i32));
        let line = _mm256_add_epi32(ahead, _mm256_and_si256(later, steps));
        Rows { patch_row: _mm256_sub_epi32(line, top), line, later }
    }

    /// The lanes whose patches have such a row, on the micro-image and lit.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn valid(&self, eight: &Eight, rows: &Rows, column: __m256i) -> u32 {
        let (columns, side) = (self.patches.columns as i32, self.array.side as i32);
        let above = |a: __m256i, b: i32| _mm256_cmpgt_epi32(a, _mm256_set1_epi32(b));
        let below = |a: __m256i, b: i32| _mm256_cmpgt_epi32(_mm256_set1_epi32(b), a);
        let on_patch = _mm256_and_si256(above(rows.patch_row, -1), below(rows.patch_row, self.patches.rows as i32));
        let on_image = _mm256_and_si256(above(column, -columns), below(column, side));
        let valid = _mm256_and_si256(_mm256_and_si256(on_patch, on_image), below(rows.line, side));
        let is_lit = _mm256_cmp_ps::<_CMP_LT_OQ>(eight.far2, _mm256_set1_ps(self.farthest2));
        _mm256_movemask_ps(_mm256_and_ps(_mm256_castsi256_ps(valid), is_lit)) as u32
    }

    /// See [`Narrow::class`].
    #[inline]
    #[target_feature(enable = "avx2")]
    fn classes(&self, first: usize, Eight { u, v, .. }: &Eight) -> __m256i {
        let Self { array, slice, patches, .. } = *self;
        let all = |value: f32| _mm256_set1_ps(value);
        let refocus = _mm256_mul_ps(load(&array.refocus, first), all(slice.alpha));
        let mut width = _mm256_mul_ps(_mm256_sub_ps(load(&array.per_mm, first), refocus), all(slice.per_slope));
        if let Some(node) = self.node {
            let [constant, by_x, by_y, by_square] = node.width.map(all);
            let square = _mm256_add_ps(_mm256_mul_ps(*u, *u), _mm256_mul_ps(*v, *v));
            let linear = _mm256_add_ps(constant, _mm256_mul_ps(by_x, *u));
            let curved = _mm256_add_ps(_mm256_mul_ps(by_y, *v), _mm256_mul_ps(by_square, square));
            width = _mm256_mul_ps(width, _mm256_add_ps(linear, curved));
        }
        let class = _mm256_mul_ps(_mm256_sub_ps(width, all(patches.least_width)), all(patches.per_width));
        _mm256_cvtps_epi32(_mm256_min_ps(_mm256_max_ps(class, all(0.0)), all((patches.classes - 1) as f32)))
    }

    /// Approximately the share of the light that passes the stop.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn inside(&self, far2: __m256) -> __m256 {
        let all = |value: f32| _mm256_set1_ps(value);
        let within = _mm256_sub_ps(all(self.stop.half_mm * self.stop.half_mm), far2);
        let inside = _mm256_add_ps(_mm256_mul_ps(within, all(self.per_reach)), all(0.5));
        _mm256_max_ps(_mm256_min_ps(inside, all(1.0)), all(0.0))
    }
}

/// Rounds down.
#[inline]
#[target_feature(enable = "avx2")]
fn below(phases: __m256) -> __m256i {
    _mm256_cvtps_epi32(_mm256_sub_ps(phases, _mm256_set1_ps(0.5)))
}
