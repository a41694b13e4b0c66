//! Exact weights of a straight-ray camera whose lattice is not aligned with the pixels.
//!
//! A lenslet's image of a voxel is one of the slice's [`Patches`], found by its place among the pixels: to 1/128 px, or
//! to as little on the array. If the stop cuts the image, `cut.rs` computes what is left of each pixel. The oracle is
//! `pieces.rs`.

use super::array::Array;
use super::cut::{CutBuffers, CutImage, LensletImage};
use super::patch::{self, Patches};
use super::slice::SliceOptics;
use crate::weights::geometry::Geometry;
use crate::weights::rows::RowSet;
use glam::DVec2;
use std::sync::OnceLock;

/// Weights from tables of a lenslet's image of a voxel.
#[derive(Debug, Clone)]
pub struct Lenslets {
    pub(crate) geometry: Geometry,
    /// Centres of the lenslets.
    array: Array,
    /// The patches of each slice, made when first used.
    patches: Vec<OnceLock<Patches>>,
    /// The same with pixels cut into [`FINENESS`] parts, for cells with slanted sides that the stop cuts.
    fine_patches: Vec<OnceLock<Patches>>,
}

/// Buffers of a thread, for the slice and the rows last asked for.
#[derive(Debug, Default)]
pub(crate) struct Buffers {
    slice: Option<SliceOptics>,
    wanted: Option<RowSet>,
    /// For each row the first wanted at or after it.
    next: Vec<u32>,
    cut: CutBuffers,
}

/// Parts of a pixel a side at the stop's edge, for cells with slanted sides. Whole pixels err by 1.2 % of a voxel's
/// light and cost 0.01 of Q.
const FINENESS: i32 = 2;

/// A lenslet is wholly inside the stop if its cell, widened by this share of the blur, is. The light farther out is
/// little and is not cut.
const BLUR_INSIDE: f64 = 0.4;

/// A voxel's chief ray.
#[derive(Clone, Copy)]
struct Chief {
    /// Where it meets the array, mm.
    array_mm: DVec2,
    /// Its part of the place of a patch's middle, px.
    place_px: DVec2,
}

impl Lenslets {
    pub(crate) fn new(geometry: Geometry) -> Self {
        // The image of a lenslet farther out lies beside the sensor.
        let optics = &geometry.optics;
        let half_mm = 0.5 * optics.pixel_pitch_mm() * DVec2::new(geometry.width as f64, geometry.height as f64);
        let image = optics.demagnification() * optics.half_aperture_mm();
        let array = Array::new(optics.lattice(), half_mm + DVec2::splat(image + geometry.pitch_mm));
        let patches = vec![OnceLock::new(); geometry.grid.shape[2]];
        Self { array, fine_patches: patches.clone(), patches, geometry }
    }

    /// Bytes of the tables, in all slices except those nearest focus.
    pub(crate) fn table_bytes(&self) -> u64 {
        let tables = if self.fineness() > 1 { 2 } else { 1 };
        (self.patches.len() * tables * patch::SLICE_BYTES) as u64
    }

    #[inline(always)]
    fn fineness(&self) -> i32 {
        if self.geometry.slabs.len() > 1 { FINENESS } else { 1 }
    }

    /// The patches of a slice.
    #[inline(always)]
    fn patches(&self, slice: &SliceOptics) -> &Patches {
        self.patches[slice.z].get_or_init(|| self.new_patches(slice, slice.step_mm))
    }

    /// The patches of a slice for images that the stop cuts.
    #[inline(always)]
    fn fine_patches(&self, slice: &SliceOptics) -> &Patches {
        if self.fineness() == 1 {
            return self.patches(slice);
        }
        self.fine_patches[slice.z].get_or_init(|| self.new_patches(slice, slice.step_mm / f64::from(FINENESS)))
    }

    fn new_patches(&self, slice: &SliceOptics, step_mm: f64) -> Patches {
        let blurs = [self.geometry.blur(&slice.axis, 0), self.geometry.blur(&slice.axis, 1)];
        Patches::new(&self.geometry.slabs, blurs, step_mm)
    }

    /// See [`crate::weights::Weights::runs`].
    #[inline(always)]
    pub(crate) fn runs(
        &self,
        voxel: [usize; 3],
        buffers: &mut Buffers,
        wanted: RowSet,
        mut found: impl FnMut(u32, u32, f32, &[f32]),
    ) {
        let z = voxel[2];
        let slice = match &buffers.slice {
            Some(slice) if slice.z == z => *slice,
            _ => *buffers.slice.insert(SliceOptics::new(&self.geometry, z)),
        };
        if buffers.wanted != Some(wanted) {
            buffers.next = wanted.next_from(self.geometry.height);
            buffers.wanted = Some(wanted);
        }
        let Buffers { next, cut, .. } = buffers;
        let patches = self.patches(&slice);
        let array_mm = self.geometry.chief_mm(&slice.axis, voxel);
        let lattice = self.geometry.optics.lattice();
        let middle_px = 0.5 * DVec2::new(f64::from(self.geometry.width as i32), f64::from(self.geometry.height as i32));
        let chief = Chief { array_mm, place_px: slice.by_chief * array_mm + middle_px };
        for (j, row) in lattice.rows_within(lattice.perfect(array_mm), slice.reach + DVec2::splat(slice.spread)) {
            let centres = self.array.row_mm(j, &row);
            let Some((low, high)) = self.image_rows(&slice, patches, &chief, centres) else { continue };
            if low >= high || next[low as usize] >= high as u32 {
                continue;
            }
            for centre in centres {
                self.lenslet_runs(&slice, patches, &chief, *centre, cut, next, wanted, &mut found);
            }
        }
    }

    /// The image rows that a row of lenslets can light.
    #[inline(always)]
    fn image_rows(
        &self,
        slice: &SliceOptics,
        patches: &Patches,
        chief: &Chief,
        centres: &[DVec2],
    ) -> Option<(i32, i32)> {
        let mut ends = [centres.first()?.y, centres.last()?.y];
        if self.geometry.optics.lattice().departs() {
            let ys = centres.iter().map(|centre| centre.y);
            ends = [ys.clone().fold(f64::INFINITY, f64::min), ys.fold(f64::NEG_INFINITY, f64::max)];
        }
        let ends = ends.map(|y| patches.split(chief.place_px.y + slice.by_centre * y).0);
        let (low, high) = (ends[0].min(ends[1]) - 1, ends[0].max(ends[1]) + patches.rows as i32 + 1);
        Some((low.max(0), high.min(self.geometry.height as i32)))
    }

    /// The weights through one lenslet.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn lenslet_runs(
        &self,
        slice: &SliceOptics,
        patches: &Patches,
        chief: &Chief,
        centre: DVec2,
        cut: &mut CutBuffers,
        next: &[u32],
        wanted: RowSet,
        found: &mut impl FnMut(u32, u32, f32, &[f32]),
    ) {
        let (width, height) = (self.geometry.width as i32, self.geometry.height as i32);
        let (rows, columns) = (patches.rows as i32, patches.columns);
        let has_round_stop = self.geometry.has_round_stop;
        let spread2 = slice.spread * slice.spread;
        let beyond = chief.array_mm - centre;
        let (far_x, far_y) = (beyond.x.abs(), beyond.y.abs());
        let place_px = chief.place_px + slice.by_centre * centre;
        let (first_y, phase_y) = patches.split(place_px.y);
        let (low, high) = (first_y.max(0), (first_y + rows).min(height));
        if low >= high || next[low as usize] >= high as u32 {
            return;
        }
        // Take the whole image if it is inside the stop and on the sensor.
        let inside_reach = slice.corner + BLUR_INSIDE * (slice.reach - slice.corner);
        let (x, y) = (far_x + inside_reach.x, far_y + inside_reach.y);
        let is_in = if has_round_stop { x * x + y * y <= spread2 } else { x <= slice.spread && y <= slice.spread };
        let (first_x, phase_x) = patches.split(place_px.x);
        let patch = patches.at(phase_x, phase_y);
        if is_in && first_x >= 0 && first_x + columns as i32 <= width {
            let mut row = next[low as usize];
            while row < high as u32 {
                let start = (row as i32 - first_y) as usize * columns;
                found(row, first_x as u32, slice.scale, &patch[start..start + columns]);
                row += wanted.step;
            }
            return;
        }
        // Leave it if it is outside the stop.
        let (x, y) = ((far_x - slice.reach.x).max(0.0), (far_y - slice.reach.y).max(0.0));
        let is_out = if has_round_stop { x * x + y * y > spread2 } else { x > slice.spread || y > slice.spread };
        if is_out {
            return;
        }
        // Cut it otherwise.
        let image = LensletImage { centre, chief: chief.array_mm, place_px, rows: (low, high) };
        let fine = self.fine_patches(slice);
        if let Some(image) = CutImage::new(&self.geometry, slice, fine, self.fineness(), &image) {
            image.runs(cut, next, wanted, found);
        }
    }
}
