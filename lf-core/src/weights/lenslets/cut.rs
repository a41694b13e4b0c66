//! A lenslet's image of a voxel that the stop cuts or that lies partly beside the sensor. Where the cell's sides are
//! slanted, pixels are cut into parts ("fine" pixels).

use super::patch::{LANES, Patches};
use super::slice::SliceOptics;
use super::stop::{ApertureBehind, Spans};
use crate::weights::{geometry::Geometry, model::RowSet};
use glam::{DVec2, Vec4};

/// A lenslet and where its image of the voxel is.
pub(super) struct LensletImage {
    /// Centre of the lenslet, mm.
    pub(super) centre: DVec2,
    /// Where the voxel's chief ray meets the array, mm.
    pub(super) chief: DVec2,
    /// Middle of the image, px.
    pub(super) place_px: DVec2,
    /// First and end image row that may be lit.
    pub(super) rows: (i32, i32),
}

/// Buffers of a thread: the aperture behind the columns, and the light of an image row.
#[derive(Debug, Default)]
pub(super) struct CutBuffers {
    spans: Vec<Spans>,
    light: Vec<f32>,
}

/// The part of an image that the stop lets through and the sensor sees.
pub(super) struct CutImage<'a> {
    geometry: &'a Geometry,
    slice: &'a SliceOptics,
    /// The image, uncut: rows of `patch_columns` fine pixels.
    patch: &'a [f32],
    patch_columns: usize,
    /// Fine pixels of a pixel, a side.
    fineness: i32,
    per_slope: f64,
    /// The chief ray's place from the lenslet's centre, mm.
    beyond: DVec2,
    /// The fine pixel edge that U = 0 meets.
    zero: DVec2,
    /// First fine column and row of the patch.
    first: (i32, i32),
    /// First and end: fine columns, fine rows, and image rows.
    columns: (i32, i32),
    fine_rows: (i32, i32),
    rows: (i32, i32),
}

/// The aperture behind four fine rows from `first`.
struct RowsBehind {
    first: i32,
    /// Half chords of the stop at the nodes of each row.
    nodes: [Vec4; 3],
    middles: Vec4,
}

impl<'a> CutImage<'a> {
    /// Cuts the image of a lenslet; None if nothing is left.
    #[inline(always)]
    pub(super) fn new(
        geometry: &'a Geometry,
        slice: &'a SliceOptics,
        patches: &'a Patches,
        fineness: i32,
        image: &LensletImage,
    ) -> Option<Self> {
        let LensletImage { centre, chief, place_px, rows: (low, high) } = *image;
        let per_px = f64::from(fineness);
        let axis_px = (slice.axis.lenslet_gain * centre + slice.axis.array_gain * chief) * slice.per_pixel;
        let zero = per_px * (axis_px + geometry.optics.middle_px());
        let (first_x, phase_x) = patches.split(per_px * place_px.x);
        let (first_y, phase_y) = patches.split(per_px * place_px.y);
        let (stop_x, stop_y) = (slice.stop_pixels(zero.x, per_px), slice.stop_pixels(zero.y, per_px));
        let left = first_x.max(stop_x.0).max(0);
        let right =
            (first_x + patches.columns as i32).min(stop_x.1).min(geometry.optics.sensor_px[0] as i32 * fineness);
        let (low_fine, high_fine) = (first_y.max(stop_y.0), (first_y + patches.rows as i32).min(stop_y.1));
        let (low, high) = (low.max(low_fine.div_euclid(fineness)), high.min((high_fine - 1).div_euclid(fineness) + 1));
        (left < right && low < high).then(|| Self {
            geometry,
            slice,
            patch: patches.at(phase_x, phase_y),
            patch_columns: patches.columns,
            fineness,
            per_slope: slice.per_slope / per_px,
            beyond: chief - centre,
            zero,
            first: (first_x, first_y),
            columns: (left, right),
            fine_rows: (low_fine, high_fine),
            rows: (low, high),
        })
    }

    /// Calls `found` for each wanted row; see [`crate::weights::Weights::runs`].
    #[inline(always)]
    pub(super) fn runs(
        &self,
        CutBuffers { spans, light }: &mut CutBuffers,
        next: &[u32],
        wanted: RowSet,
        found: &mut impl FnMut(u32, u32, f32, &[f32]),
    ) {
        let Self { slice, fineness, beyond, columns: (left, right), .. } = *self;
        let first_pixel = left / fineness;
        let pixels = ((right - 1) / fineness + 1 - first_pixel) as usize;
        let corner = slice.corner;
        let down = slice.aperture_behind(self.zero.y, beyond.y, [-corner.y, corner.y], self.per_slope);
        let is_slanted = self.geometry.slabs.len() > 1;
        if !is_slanted {
            self.spans_behind(spans, [-corner.x, corner.x]);
        }
        let mut behind = RowsBehind { first: i32::MIN, nodes: [Vec4::ZERO; 3], middles: Vec4::ZERO };
        let mut row = next[self.rows.0 as usize];
        while row < self.rows.1 as u32 {
            light.clear();
            light.resize(pixels.next_multiple_of(LANES), 0.0);
            let start = row as i32 * fineness;
            for fine_row in start.max(self.fine_rows.0)..(start + fineness).min(self.fine_rows.1) {
                let lane = (fine_row - self.first.1) as usize % LANES;
                if fine_row - lane as i32 != behind.first {
                    behind = self.rows_behind(&down, fine_row - lane as i32);
                }
                if is_slanted {
                    // The cell has another width at each height.
                    let height = beyond.y + slice.axis.alpha * f64::from(behind.middles[lane]);
                    self.spans_behind(spans, self.geometry.edges_at(height));
                }
                self.add_row(fine_row, behind.nodes.map(|node| node[lane]), spans, light);
            }
            found(row, first_pixel as u32, slice.scale, light);
            row += wanted.step;
        }
    }

    /// The spans of the aperture behind the fine columns, for a cell from `cell[0]` to `cell[1]`.
    #[inline(always)]
    fn spans_behind(&self, spans: &mut Vec<Spans>, cell: [f64; 2]) {
        let across = self.slice.aperture_behind(self.zero.x, self.beyond.x, cell, self.per_slope);
        let (left, right) = self.columns;
        spans.clear();
        spans.extend((left..right).step_by(LANES).map(|first| across.spans(first)));
    }

    #[inline(always)]
    fn rows_behind(&self, down: &ApertureBehind, first: i32) -> RowsBehind {
        let behind = down.spans(first);
        let half = self.slice.half;
        let nodes = if self.geometry.has_round_stop { behind.half_chords(half) } else { [behind.within(half); 3] };
        RowsBehind { first, nodes, middles: behind.middles() }
    }

    /// Adds what the stop leaves of a fine row to the light of its image row.
    #[inline(always)]
    fn add_row(&self, fine_row: i32, nodes: [f32; 3], spans: &[Spans], light: &mut [f32]) {
        let Self { fineness, columns: (left, right), .. } = *self;
        let count = (right - left) as usize;
        let first_pixel = left / fineness;
        let start = (fine_row - self.first.1) as usize * self.patch_columns + (left - self.first.0) as usize;
        let shares = &self.patch[start..start + count];
        for (n, spans) in spans.iter().enumerate() {
            let through = if self.geometry.has_round_stop {
                spans.within_chords(nodes)
            } else {
                nodes[0] * spans.within(self.slice.half)
            };
            let four = next_four(&shares[LANES * n..]) * through;
            if fineness == 1 {
                four.write_to_slice(&mut light[LANES * n..]);
                continue;
            }
            for (lane, value) in four.to_array().into_iter().enumerate().take(count - LANES * n) {
                light[((left + (LANES * n + lane) as i32) / fineness - first_pixel) as usize] += value;
            }
        }
    }
}

/// The next four values, 0 behind the last.
#[inline(always)]
fn next_four(shares: &[f32]) -> Vec4 {
    match shares {
        [a, b, c, d, ..] => Vec4::new(*a, *b, *c, *d),
        _ => Vec4::from_array(std::array::from_fn(|n| shares.get(n).copied().unwrap_or(0.0))),
    }
}
