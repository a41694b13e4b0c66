//! The lenslets that a segment of voxels lights, and the rows of their patches that fall on wanted image rows.

use super::array::{LANES, LensletArray};
use super::bend::Node;
use super::hits::Hits;
use super::narrow::{Narrow, floor};
use super::slices::{Light, SliceLight};
use super::stop::Stop;
use super::wanted::Wanted;
use super::wide::{LensletView, WideRow};
use crate::simd::Level;
use crate::weights::model::RowSet;

/// Voxels of one line, near to each other: where their chief rays meet the array, mm.
#[derive(Debug, Default)]
pub(super) struct Segment {
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
}

/// Receives the light of voxels.
pub(super) trait LightSink {
    /// Adds hits of the segment's voxels.
    fn add_hits(&mut self, hits: &Hits);
    /// Adds the light of a voxel on a row of a micro-image that begins at `values`; a pixel has `parts` parts.
    fn add_row(&mut self, voxel: usize, row: &WideRow, parts: usize, values: usize);
}

/// The image rows where the patches of a segment begin under each row of lenslets; linear in the row of lenslets.
struct Tops {
    first_row: usize,
    /// The place at the first row of lenslets and the step to the next, at either end of the segment.
    first: [f32; 2],
    step: [f32; 2],
    /// Upper bound of the distance of the other patches of a row.
    slack: f32,
}

impl Tops {
    #[inline(always)]
    fn new(beam: &SliceBeam, segment: &Segment, first_row: usize, last_row: usize, reach: f32) -> Self {
        let SliceBeam { array, slice, .. } = *beam;
        let half_px = if let Light::Narrow(patches) = &slice.light { patches.half_px } else { 0.0 };
        let [along_x, along_y] = array.per_along;
        let slant = (along_y / along_x).abs();
        // Find the top of the patch under one lenslet near the voxel, for either end of the segment.
        let at = |row: usize, n: usize| {
            let start_x = array.starts[row][0];
            let number = (((segment.x[n] - start_x) * along_x).max(0.0) as usize).min(array.length - LANES - 1);
            let lenslet = row * array.length + number;
            let down = array.y[lenslet] - segment.y[n];
            // Take straight rays; `slack` covers the bend. Polynomials do not hold for lenslets far from the beam.
            let v = down * slice.per_alpha;
            array.row[lenslet] as f32 + array.middle_y[lenslet] - array.per_mm[lenslet] * v - half_px
        };
        let last = segment.x.len() - 1;
        let first = [at(first_row, 0), if last > 0 { at(first_row, last) } else { at(first_row, 0) }];
        let end = [at(last_row, 0), if last > 0 { at(last_row, last) } else { at(last_row, 0) }];
        // Interpolate between the first and the last row of lenslets.
        let per_row = 1.0 / (last_row - first_row).max(1) as f32;
        let bend = (array.per_pixel - array.per_mm[first_row * array.length] * slice.per_alpha).abs();
        Self {
            first_row,
            first,
            step: [(end[0] - first[0]) * per_row, (end[1] - first[1]) * per_row],
            slack: 0.02 + slice.slack + slant * reach * bend + array.slack * (1.0 + bend / array.per_pixel),
        }
    }

    /// Whether patches under a row of lenslets can have a row of the set.
    #[inline(always)]
    fn have_wanted(&self, row: usize, patch_rows: usize, rows: RowSet) -> bool {
        let away = (row - self.first_row) as f32;
        let [a, b] = [self.first[0] + away * self.step[0], self.first[1] + away * self.step[1]];
        // Widen the range of tops by the slack and by a patch.
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        let (low, high) = (floor(low - self.slack), floor(high + self.slack) + patch_rows as i32);
        // Find the first row of the set from `low` on, in floats, which divide faster.
        let (step, ahead) = (rows.step as f32, (rows.first as i32 - low) as f32);
        let ahead = ahead - step * (floor(ahead / step + 1e-3) as f32);
        ((ahead + 0.5) as i32) + low < high
    }
}

/// The lenslets of a row that each voxel of a segment can light: from `first` up to `end`.
#[derive(Debug, Default)]
pub(super) struct Reached {
    first: Vec<i32>,
    end: Vec<i32>,
}

impl Reached {
    /// For a row of lenslets, and rays within the squared distance `reach2` of the chief ray, mm^2.
    #[inline(always)]
    fn set(&mut self, array: &LensletArray, row: usize, segment: &Segment, reach2: f32) {
        let [along_x, along_y] = array.per_along;
        let length = 1.0 / (along_x * along_x + along_y * along_y).sqrt();
        let per_length = 1.0 / length;
        let [start_x, start_y] = array.starts[row];
        let most = (array.length - LANES) as f32;
        let count = segment.x.len();
        self.first.resize(count, 0);
        self.end.resize(count, 0);
        let (x, y) = (&segment.x[..count], &segment.y[..count]);
        let (first, end) = (&mut self.first[..count], &mut self.end[..count]);
        for voxel in 0..count {
            // Project the chief ray on the row: the place along it, and the distance from it.
            let (dx, dy) = (x[voxel] - start_x, y[voxel] - start_y);
            let middle = dx * along_x + dy * along_y;
            let away = (dy * along_x - dx * along_y) * length;
            // Take the chord of the reach on the row, within the row's lenslets.
            let width2 = reach2 - away * away;
            let width = if width2 > 0.0 { width2 } else { 0.0 }.sqrt() * per_length;
            let (low, high) = (middle - width + 1.0, middle + width + 1.0);
            let low = if low > 0.0 { low } else { 0.0 };
            let high = if high > 0.0 { high } else { 0.0 };
            let high = if high < most { high } else { most };
            let low = if low < most { low } else { most };
            first[voxel] = low as i32;
            end[voxel] = if width2 > 0.0 { high as i32 } else { 0 };
        }
    }
}

/// Calls `found(voxel, row of lenslets, first, end)` for the lenslets of each row that a voxel can light.
#[inline(always)]
fn rows(
    beam: &SliceBeam,
    segment: &Segment,
    wanted: &Wanted,
    reached: &mut Reached,
    mut found: impl FnMut(usize, usize, usize, usize),
) {
    let count = segment.x.len();
    let SliceBeam { array, slice, stop: Stop { is_round, .. }, .. } = *beam;
    let reach = slice.reach_mm as f32 + array.departure as f32;
    let reach = if is_round { reach } else { std::f32::consts::SQRT_2 * reach };
    let reach_rows = reach / array.apart;
    let (origin_x, origin_y) = (array.origin.x as f32, array.origin.y as f32);
    // Find the rows of lenslets that the ends of the segment can light.
    let row_at = |n: usize| {
        (segment.x[n] - origin_x) * array.per_across[0] + (segment.y[n] - origin_y) * array.per_across[1]
            - array.first_row as f32
    };
    let ends = [0, count - 1];
    let at = [row_at(ends[0]), row_at(ends[1])];
    let first_row = ((at[0].min(at[1]) - reach_rows).max(0.0) as usize).max(wanted.lenslets.start);
    let end_row = ((at[0].max(at[1]) + reach_rows + 1.0).max(0.0) as usize).min(wanted.lenslets.end);
    if first_row >= end_row {
        return;
    }
    // Walk over the rows on whose patches a wanted image row falls.
    let tops = Tops::new(beam, segment, first_row, end_row - 1, reach);
    for row in first_row..end_row {
        if let Light::Narrow(patches) = &slice.light
            && !tops.have_wanted(row, patches.rows, wanted.rows)
        {
            continue;
        }
        reached.set(array, row, segment, reach * reach);
        for voxel in 0..count {
            let (first, end) = (reached.first[voxel] as usize, reached.end[voxel] as usize);
            if first < end {
                found(voxel, row, first, end);
            }
        }
    }
}

/// Light of a slice's voxels, in one part of the field.
#[derive(Clone, Copy)]
pub(super) struct SliceBeam<'a> {
    pub(super) array: &'a LensletArray,
    pub(super) slice: &'a SliceLight,
    /// How rays bend there; None if they are straight.
    pub(super) node: Option<&'a Node>,
    pub(super) stop: Stop,
}

/// Buffers of a walk.
pub(super) struct WalkBuffers {
    hits: Hits,
    row: WideRow,
    reached: Reached,
}

impl WalkBuffers {
    /// For micro-images of `side` pixels.
    pub(super) fn new(side: usize) -> Self {
        Self { hits: Hits::new(), row: WideRow::new(side), reached: Reached::default() }
    }
}

/// Finds the light of a segment's voxels.
#[inline(always)]
pub(super) fn walk<const WEIGHS: bool>(
    beam: &SliceBeam,
    segment: &Segment,
    wanted: &Wanted,
    found: &mut WalkBuffers,
    sink: &mut impl LightSink,
) {
    if segment.x.is_empty() {
        return;
    }
    match &beam.slice.light {
        Light::Narrow(_) => walk_narrow::<WEIGHS>(beam, segment, wanted, found, sink),
        Light::Wide(_) => walk_wide::<WEIGHS>(beam, segment, wanted, found, sink),
    }
}

impl<'a> SliceBeam<'a> {
    /// The slice's table of patches, as a walk reads it; None for a slice without a table.
    #[inline(always)]
    pub(super) fn narrow(&self, wanted: &'a Wanted<'a>) -> Option<Narrow<'a>> {
        let SliceBeam { array, slice, node, stop } = *self;
        let Light::Narrow(patches) = &slice.light else { return None };
        let whole = (stop.half_mm - slice.reach_stop - slice.margin).max(0.0);
        Some(Narrow {
            array,
            slice,
            patches,
            stop,
            per_reach: 0.25 / (stop.half_mm * slice.reach_stop),
            whole2: if patches.moments[0].is_empty() { f32::INFINITY } else { whole * whole },
            farthest2: (stop.half_mm + slice.reach_stop).powi(2),
            wanted,
            node,
            is_avx2: Level::detect() >= Level::Avx2,
        })
    }
}

#[inline(always)]
fn walk_narrow<const WEIGHS: bool>(
    beam: &SliceBeam,
    segment: &Segment,
    wanted: &Wanted,
    WalkBuffers { hits, reached, .. }: &mut WalkBuffers,
    sink: &mut impl LightSink,
) {
    let Some(narrow) = beam.narrow(wanted) else { return };
    // Whether a patch has at most one wanted row.
    let is_single = wanted.layout.slots <= 2 && narrow.patches.rows <= wanted.rows.step as usize;
    rows(
        beam,
        segment,
        wanted,
        reached,
        #[inline(always)]
        |voxel, row, first, end| {
            let voxel = (voxel, segment.x[voxel], segment.y[voxel]);
            // Collect hits of eight lenslets at a time, and use them when there are enough.
            let slots = if is_single { 1 } else { wanted.layout.slots };
            for number in (first..end).step_by(LANES) {
                for slot in 0..slots {
                    narrow.eight::<WEIGHS>(row, number, end, (!is_single).then_some(slot), voxel, hits);
                    if hits.are_full() {
                        sink.add_hits(hits);
                        hits.clear();
                    }
                }
            }
        },
    );
    sink.add_hits(hits);
    hits.clear();
}

#[inline(always)]
fn walk_wide<const WEIGHS: bool>(
    beam: &SliceBeam,
    segment: &Segment,
    wanted: &Wanted,
    WalkBuffers { row: out, reached, .. }: &mut WalkBuffers,
    sink: &mut impl LightSink,
) {
    let SliceBeam { array, slice, node, .. } = *beam;
    let Light::Wide(wide) = &slice.light else { return };
    let step = wanted.rows.step as i32;
    let reach2 = (slice.reach_mm * slice.reach_mm) as f32;
    rows(
        beam,
        segment,
        wanted,
        reached,
        #[inline(always)]
        |voxel, row, first, end| {
            for number in first..end {
                // Skip a lenslet that the light of a round stop cannot reach.
                let lenslet = row * array.length + number;
                let offset = [segment.x[voxel] - array.x[lenslet], segment.y[voxel] - array.y[lenslet]];
                if beam.stop.is_round && offset[0] * offset[0] + offset[1] * offset[1] > reach2 {
                    continue;
                }
                let view = LensletView {
                    middle: [array.middle_x[lenslet], array.middle_y[lenslet]],
                    offset,
                    per_mm: array.per_mm[lenslet],
                    refocus: array.refocus[lenslet],
                };
                // Compute the light of each wanted row of the micro-image.
                let ahead = wanted.rows.first as i32 - wanted.remainders[lenslet];
                let ahead = if ahead < 0 { ahead + step } else { ahead } as usize;
                for slot in 0..wanted.layout.slots {
                    let line = ahead + slot * step as usize;
                    if line < array.side && wide.may_light(&view, line) && wide.row::<WEIGHS>(&view, node, line, out) {
                        let place = wanted.layout.place(row - wanted.lenslets.start, number, slot);
                        sink.add_row(voxel, out, wide.parts(), place);
                    }
                }
            }
        },
    );
}
