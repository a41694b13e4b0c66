//! Where the patches of a voxel fall under eight lenslets of a row.

use super::array::{LANES, LensletArray};
use super::bend::Node;
use super::hits::Hits;
use super::patches::{ACROSS, Patches};
use super::slices::SliceLight;
use super::stop::Stop;
use super::wanted::Wanted;

/// Rounds down, for values within 2^21.
#[inline(always)]
pub(super) fn floor(value: f32) -> i32 {
    const WHOLE: f32 = 12_582_912.0;
    (value - 0.5 + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32
}

/// A slice with a table of patches.
pub(super) struct Narrow<'a> {
    pub(super) array: &'a LensletArray,
    pub(super) slice: &'a SliceLight,
    pub(super) patches: &'a Patches,
    pub(super) stop: Stop,
    pub(super) per_reach: f32,
    /// Within this squared distance from the middle of the stop a lenslet's light passes uncut, mm^2.
    pub(super) whole2: f32,
    /// Beyond this squared distance no light passes, mm^2.
    pub(super) farthest2: f32,
    pub(super) wanted: &'a Wanted<'a>,
    /// How rays bend near the segment; None if they are straight.
    pub(super) node: Option<&'a Node>,
    /// Whether the machine has AVX2.
    pub(super) is_avx2: bool,
}

impl Narrow<'_> {
    /// Adds the hits of a voxel (its number in the segment, x, y) under eight lenslets of a row, from `number` on: in
    /// one row of the set or in all rows.
    #[inline(always)]
    pub(super) fn eight<const WEIGHS: bool>(
        &self,
        row: usize,
        number: usize,
        end: usize,
        slot: Option<usize>,
        voxel: (usize, f32, f32),
        hits: &mut Hits,
    ) {
        #[cfg(target_arch = "x86_64")]
        if self.is_avx2 {
            // SAFETY: the machine has AVX2.
            unsafe { self.eight_avx2::<WEIGHS>(row, number, end, slot, voxel, hits) };
            return hits.end_group(voxel.0);
        }
        self.eight_portable(row, number, end, slot, voxel, hits);
        hits.end_group(voxel.0);
    }

    /// The portable way: lenslet by lenslet.
    #[inline(always)]
    fn eight_portable(
        &self,
        row: usize,
        number: usize,
        end: usize,
        slot: Option<usize>,
        (voxel, x0, y0): (usize, f32, f32),
        hits: &mut Hits,
    ) {
        let Self { array, slice, patches, stop, wanted, .. } = *self;
        let step = wanted.rows.step as i32;
        let first = row * array.length + number;
        for n in 0..LANES.min(end - number) {
            let lenslet = first + n;
            // Find the place in the stop that the lenslet's centre shows, and the patch's middle on the micro-image.
            let (across_mm, down_mm) = (array.x[lenslet] - x0, array.y[lenslet] - y0);
            let (u, v) = match self.node {
                None => (across_mm * slice.per_alpha, down_mm * slice.per_alpha),
                Some(node) => node.aperture(slice.alpha, slice.per_alpha, across_mm, down_mm),
            };
            let scale = array.per_mm[lenslet];
            let (x, y) = (array.middle_x[lenslet] - scale * u, array.middle_y[lenslet] - scale * v);
            // Estimate the share of the light that passes the stop.
            let far2 = if stop.is_round { u * u + v * v } else { u.abs().max(v.abs()).powi(2) };
            let inside = ((stop.half_mm * stop.half_mm - far2) * self.per_reach + 0.5).clamp(0.0, 1.0);
            // Split the patch's first corner into pixels and phases.
            let places = (x - patches.half_px) * ACROSS as f32;
            let (across, down) = (floor(places), floor((y - patches.half_px) * patches.per_px));
            let (column, top) = (across >> ACROSS.ilog2(), down >> patches.bits);
            // Find the row of the patch that falls on the wanted row.
            let ahead = wanted.rows.first as i32 - wanted.remainders[lenslet];
            let ahead = if ahead < 0 { ahead + step } else { ahead };
            let slot = slot.map_or(i32::from(ahead < top), |slot| slot as i32);
            let line = ahead + slot * step;
            let patch_row = line - top;
            let is_valid = far2 < self.farthest2
                && (0..patches.rows as i32).contains(&patch_row)
                && line < array.side as i32
                && column > -(patches.columns as i32)
                && column < array.side as i32;
            if is_valid {
                // Store the hit, also among those that the stop may cut.
                let mask = (1 << patches.bits) - 1;
                let place = wanted.layout.place(row - wanted.lenslets.start, number + n, slot as usize) as i32;
                let phase = (self.class(lenslet, u, v) << patches.bits) | (down & mask);
                let line = phase * patches.rows as i32 + patch_row;
                let shares = (line * (ACROSS as i32 + 1) + (across & (ACROSS as i32 - 1))) * patches.columns as i32;
                let at = hits.all.count;
                (hits.lines[at], hits.inside[at]) = (line, inside);
                for list in std::iter::once(&mut hits.all).chain((far2 > self.whole2).then_some(&mut hits.cut)) {
                    (list.shares[list.count], list.values[list.count]) = (shares, place + column);
                    list.columns[list.count] = column;
                    (list.voxels[list.count], list.parts[list.count]) = (voxel as i32, places - across as f32);
                    list.count += 1;
                }
            }
        }
    }

    /// The class of the patch under a lenslet, from the place in the stop that its centre shows.
    #[inline(always)]
    fn class(&self, lenslet: usize, u: f32, v: f32) -> i32 {
        if self.patches.classes == 1 {
            return 0;
        }
        let Self { array, slice, patches, .. } = *self;
        let slope = array.per_mm[lenslet] - array.refocus[lenslet] * slice.alpha;
        let by_bend = self.node.map_or(1.0, |node| {
            let [constant, by_x, by_y, by_square] = node.width;
            constant + by_x * u + by_y * v + by_square * (u * u + v * v)
        });
        let class = (slope * slice.per_slope * by_bend - patches.least_width) * patches.per_width;
        (class + 0.5).clamp(0.0, (patches.classes - 1) as f32) as i32
    }
}
