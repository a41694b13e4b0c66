//! Exact weights of a straight-ray camera whose lattice is not aligned with the pixels.
//!
//! A lenslet's image of a voxel is one of the slice's [`LensletPatches`], selected by its place among the pixels to
//! 1/128 px, or to as little on the array. If the stop cuts the image, `cut.rs` takes over. Tests compare with
//! `pieces.rs`.

use super::cut::{CutBuffers, CutImage};
use super::patch::{self, LensletPatches};
use super::slice::SliceOptics;
use crate::weights::{geometry::Geometry, model::RowSet};
use glam::DVec2;
use std::{ops::RangeInclusive, sync::OnceLock};

/// Weights from tables of a lenslet's image of a voxel.
#[derive(Debug, Clone)]
pub struct Lenslets {
    pub(crate) geometry: Geometry,
    /// First lenslet and centres, mm, of the rows that the sensor sees; `first_row` is the first of these rows.
    rows: Vec<(i64, Vec<DVec2>)>,
    first_row: i64,
    /// The patches of each slice, made when first used.
    patches: Vec<OnceLock<LensletPatches>>,
    /// Like `patches`, but in fine pixels, [`FINENESS`] a side: for cells with slanted sides that the stop cuts.
    fine_patches: Vec<OnceLock<LensletPatches>>,
    fineness: i32,
}

/// Buffers of a thread, for the slice and the rows last asked for.
#[derive(Debug, Default)]
pub(crate) struct LookupBuffers {
    slice: Option<SliceOptics>,
    wanted: Option<RowSet>,
    /// For each row the first wanted at or after it.
    next: Vec<u32>,
    cut: CutBuffers,
}

/// Fine pixels of a pixel, a side; see `cut.rs`. Whole pixels are off by 1.2 % of a voxel's light and cost 0.01 of Q.
const FINENESS: i32 = 2;

/// A lenslet counts as inside the stop if its cell, widened by this share of the blur, is. Little light lies outside.
const BLUR_INSIDE: f64 = 0.4;

/// A voxel and the rows asked for.
struct Request<'a> {
    lenslets: &'a Lenslets,
    slice: &'a SliceOptics,
    patches: &'a LensletPatches,
    chief_mm: DVec2,
    /// The chief ray's part of the place of a patch's middle, px.
    chief_px: DVec2,
    wanted: RowSet,
    next: &'a [u32],
}

impl Lenslets {
    /// Bytes of a slice before its tables are made.
    pub(crate) const LIST_BYTES: usize = 2 * size_of::<OnceLock<LensletPatches>>();

    pub(crate) fn new(geometry: Geometry) -> Self {
        let optics = &geometry.optics;
        let reach_mm = optics.seen_mm() + geometry.pitch_mm;
        let lattice = optics.lattice();
        let seen = || lattice.rows_within(DVec2::ZERO, reach_mm);
        let rows = seen().map(|(j, row)| (*row.start(), row.map(|i| lattice.centre_mm(i, j)).collect())).collect();
        let first_row = seen().next().map_or(0, |(j, _)| j);
        let patches = vec![OnceLock::new(); geometry.grid.shape[2]];
        let fineness = if geometry.slabs.len() > 1 { FINENESS } else { 1 };
        Self { rows, first_row, fine_patches: patches.clone(), patches, fineness, geometry }
    }

    pub(crate) fn table_bytes(&self) -> u64 {
        let tables = if self.fineness > 1 { 2 } else { 1 };
        (self.patches.len() * tables * patch::SLICE_BYTES) as u64
    }

    /// Centres of those lenslets of row `j` that the sensor sees, mm.
    #[inline(always)]
    fn centres_mm(&self, j: i64, lenslets: &RangeInclusive<i64>) -> &[DVec2] {
        let row = usize::try_from(j - self.first_row).ok().and_then(|n| self.rows.get(n));
        let Some((zero, centres)) = row else { return &[] };
        let first = (lenslets.start() - zero).clamp(0, centres.len() as i64);
        let end = (lenslets.end() + 1 - zero).clamp(first, centres.len() as i64);
        &centres[first as usize..end as usize]
    }

    #[inline(always)]
    fn patches(&self, slice: &SliceOptics) -> &LensletPatches {
        self.patches[slice.z].get_or_init(|| self.new_patches(slice, slice.step_mm))
    }

    #[inline(always)]
    fn fine_patches(&self, slice: &SliceOptics) -> &LensletPatches {
        if self.fineness == 1 {
            return self.patches(slice);
        }
        self.fine_patches[slice.z].get_or_init(|| self.new_patches(slice, slice.step_mm / f64::from(self.fineness)))
    }

    fn new_patches(&self, slice: &SliceOptics, step_mm: f64) -> LensletPatches {
        LensletPatches::new(&self.geometry.slabs, self.geometry.blurs(&slice.axis), step_mm)
    }

    #[inline(always)]
    pub(crate) fn runs(
        &self,
        voxel: [usize; 3],
        buffers: &mut LookupBuffers,
        wanted: RowSet,
        mut found: impl FnMut(u32, u32, f32, &[f32]),
    ) {
        // Reuse the slice's optics and the wanted rows of the last call.
        let z = voxel[2];
        let slice = match &buffers.slice {
            Some(slice) if slice.z == z => *slice,
            _ => *buffers.slice.insert(SliceOptics::new(&self.geometry, z)),
        };
        if buffers.wanted != Some(wanted) {
            buffers.next = wanted.next_from(self.geometry.optics.sensor_px[1]);
            buffers.wanted = Some(wanted);
        }
        let optics = &self.geometry.optics;
        let chief_mm = self.geometry.chief_mm(&slice.axis, voxel);
        let request = Request {
            lenslets: self,
            slice: &slice,
            patches: self.patches(&slice),
            chief_mm,
            chief_px: slice.by_chief * chief_mm + optics.middle_px(),
            wanted,
            next: &buffers.next,
        };
        // Look up the image under each lenslet that the voxel lights.
        let lattice = optics.lattice();
        for (j, row) in lattice.rows_within(lattice.perfect(chief_mm), slice.reach + DVec2::splat(slice.spread)) {
            let centres = self.centres_mm(j, &row);
            if request.is_reached(centres) {
                for centre in centres {
                    request.runs(*centre, &mut buffers.cut, &mut found);
                }
            }
        }
    }
}

impl Request<'_> {
    /// Whether a row of lenslets can light a wanted image row.
    #[inline(always)]
    fn is_reached(&self, centres: &[DVec2]) -> bool {
        let (Some(start), Some(end)) = (centres.first(), centres.last()) else { return false };
        let mut ends = [start.y, end.y];
        if self.lenslets.geometry.optics.lattice().departs() {
            let ys = centres.iter().map(|centre| centre.y);
            ends = [ys.clone().fold(f64::INFINITY, f64::min), ys.fold(f64::NEG_INFINITY, f64::max)];
        }
        let ends = ends.map(|y| self.patches.split(self.chief_px.y + self.slice.by_centre * y).0);
        let (low, high) = (ends[0].min(ends[1]) - 1, ends[0].max(ends[1]) + self.patches.rows as i32 + 1);
        self.has_wanted(low.max(0), high.min(self.lenslets.geometry.optics.sensor_px[1] as i32))
    }

    /// Whether any of the image rows `low..high` is wanted.
    #[inline(always)]
    fn has_wanted(&self, low: i32, high: i32) -> bool {
        low < high && self.next[low as usize] < high as u32
    }

    /// The weights through one lenslet.
    #[inline(always)]
    fn runs(&self, centre: DVec2, cut: &mut CutBuffers, found: &mut impl FnMut(u32, u32, f32, &[f32])) {
        let Self { lenslets, slice, patches, next, wanted, .. } = *self;
        let geometry = &lenslets.geometry;
        let [width, height] = geometry.optics.sensor_px.map(|count| count as i32);
        let (rows, columns) = (patches.rows as i32, patches.columns);
        let place_px = self.chief_px + slice.by_centre * centre;
        let (first_y, phase_y) = patches.split(place_px.y);
        let (low, high) = (first_y.max(0), (first_y + rows).min(height));
        if !self.has_wanted(low, high) {
            return;
        }
        // Take the whole image if it is inside the stop and on the sensor.
        let far = (self.chief_mm - centre).abs();
        let inside_reach = slice.corner + BLUR_INSIDE * (slice.reach - slice.corner);
        let is_in_stop = |DVec2 { x, y }: DVec2| {
            let half = slice.spread;
            if geometry.has_round_stop { x * x + y * y <= half * half } else { x <= half && y <= half }
        };
        let (first_x, phase_x) = patches.split(place_px.x);
        let patch = patches.at(phase_x, phase_y);
        if is_in_stop(far + inside_reach) && first_x >= 0 && first_x + columns as i32 <= width {
            let mut row = next[low as usize];
            while row < high as u32 {
                let start = (row as i32 - first_y) as usize * columns;
                found(row, first_x as u32, slice.scale, &patch[start..start + columns]);
                row += wanted.step;
            }
            return;
        }
        if !is_in_stop((far - slice.reach).max(DVec2::ZERO)) {
            return;
        }
        let (patches, fineness) = (lenslets.fine_patches(slice), lenslets.fineness);
        let (chief, rows) = (self.chief_mm, (low, high));
        let image = CutImage { geometry, slice, patches, fineness, centre, chief, place_px, rows };
        image.cut_runs(cut, next, wanted, found);
    }
}
