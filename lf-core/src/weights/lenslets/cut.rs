//! A lenslet's image of a voxel that the stop cuts or that lies partly beside the sensor. Where the cell's sides are
//! slanted, pixels are cut into parts ("fine" pixels).

use super::patch::{LANES, LensletPatches};
use super::slice::{SliceOptics, Spans};
use crate::weights::{geometry::Geometry, model::RowSet};
use glam::{DVec2, Vec4};

/// A lenslet and where its image of the voxel is.
pub(super) struct CutImage<'a> {
    pub(super) geometry: &'a Geometry,
    pub(super) slice: &'a SliceOptics,
    /// The uncut images, in fine pixels.
    pub(super) patches: &'a LensletPatches,
    /// Fine pixels of a pixel, a side.
    pub(super) fineness: i32,
    /// Centre of the lenslet, and where the voxel's chief ray meets the array, mm.
    pub(super) centre: DVec2,
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

impl CutImage<'_> {
    /// [`crate::weights::Weights::runs`] for what the stop lets through and the sensor sees.
    #[inline(always)]
    pub(super) fn cut_runs(
        &self,
        CutBuffers { spans, light }: &mut CutBuffers,
        next: &[u32],
        wanted: RowSet,
        found: &mut impl FnMut(u32, u32, f32, &[f32]),
    ) {
        let Self { geometry, slice, patches, fineness, centre, chief, place_px, rows: (low, high) } = *self;
        let per_px = f64::from(fineness);
        let (beyond, corner) = (chief - centre, slice.corner);
        // Find the patch, in fine pixels.
        // Zero is the fine pixel edge that U = 0 meets.
        let axis_px = (slice.axis.lenslet_gain * centre + slice.axis.array_gain * chief) * slice.per_pixel;
        let zero = per_px * (axis_px + geometry.optics.middle_px());
        let (first_x, phase_x) = patches.split(per_px * place_px.x);
        let (first_y, phase_y) = patches.split(per_px * place_px.y);
        let patch = patches.at(phase_x, phase_y);
        // Limit columns and rows to the stop's image, the sensor and the patch.
        let (stop_x, stop_y) = (slice.stop_pixels(zero.x, per_px), slice.stop_pixels(zero.y, per_px));
        let left = first_x.max(stop_x.0).max(0);
        let right = first_x + patches.columns as i32;
        let right = right.min(stop_x.1).min(geometry.optics.sensor_px[0] as i32 * fineness);
        let (low_fine, high_fine) = (first_y.max(stop_y.0), (first_y + patches.rows as i32).min(stop_y.1));
        let (low, high) = (low.max(low_fine.div_euclid(fineness)), high.min((high_fine - 1).div_euclid(fineness) + 1));
        if left >= right || low >= high {
            return;
        }
        // Prepare the aperture behind the rows, and behind the columns if the cell is upright.
        let first_pixel = left / fineness;
        let pixels = ((right - 1) / fineness + 1 - first_pixel) as usize;
        let per_slope = slice.per_slope / per_px;
        let down = slice.aperture_behind(zero.y, beyond.y, [-corner.y, corner.y], per_slope);
        let spans_behind = |spans: &mut Vec<Spans>, cell: [f64; 2]| {
            let across = slice.aperture_behind(zero.x, beyond.x, cell, per_slope);
            spans.clear();
            spans.extend((left..right).step_by(LANES).map(|first| across.spans(first)));
        };
        let is_slanted = geometry.slabs.len() > 1;
        if !is_slanted {
            spans_behind(spans, [-corner.x, corner.x]);
        }
        // Keep the aperture behind four fine rows: half chords of the stop at three nodes, and middles.
        let (mut four, mut nodes, mut middles) = (i32::MIN, [Vec4::ZERO; 3], Vec4::ZERO);
        let mut row = next[low as usize];
        while row < high as u32 {
            // Add the fine rows of the image row.
            light.clear();
            light.resize(pixels.next_multiple_of(LANES), 0.0);
            let start = row as i32 * fineness;
            for fine_row in start.max(low_fine)..(start + fineness).min(high_fine) {
                let lane = (fine_row - first_y) as usize % LANES;
                // Look at the next four fine rows.
                if fine_row - lane as i32 != four {
                    four = fine_row - lane as i32;
                    let behind = down.spans(four);
                    let half = slice.half;
                    nodes = if geometry.has_round_stop { behind.half_chords(half) } else { [behind.within(half); 3] };
                    middles = behind.middles();
                }
                if is_slanted {
                    // Take the width of the cell at this height.
                    let height = beyond.y + slice.axis.alpha * f64::from(middles[lane]);
                    spans_behind(spans, geometry.edges_at(height));
                }
                // Cut the row of the patch by the stop.
                let start = (fine_row - first_y) as usize * patches.columns + (left - first_x) as usize;
                let shares = &patch[start..start + (right - left) as usize];
                self.add_row(shares, left, nodes.map(|node| node[lane]), spans, light);
            }
            found(row, first_pixel as u32, slice.scale, light);
            row += wanted.step;
        }
    }

    /// Adds what the stop leaves of a fine row from fine column `left` to the light of its image row.
    #[inline(always)]
    fn add_row(&self, shares: &[f32], left: i32, nodes: [f32; 3], spans: &[Spans], light: &mut [f32]) {
        let Self { geometry, slice, fineness, .. } = *self;
        let first_pixel = left / fineness;
        for (n, spans) in spans.iter().enumerate() {
            let through =
                if geometry.has_round_stop { spans.within_chords(nodes) } else { nodes[0] * spans.within(slice.half) };
            let four = next_four(&shares[LANES * n..]) * through;
            if fineness == 1 {
                four.write_to_slice(&mut light[LANES * n..]);
                continue;
            }
            for (lane, value) in four.to_array().into_iter().enumerate().take(shares.len() - LANES * n) {
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
