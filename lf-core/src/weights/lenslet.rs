//! Weights through one lenslet at a time, for lattices that are not in line with the pixels.
//!
//! The same weights as [`Footprint::visit`], which is the slow and obvious way. Here a lenslet's image of a voxel is one of
//! the slice's [`super::patch::Patches`], looked up by its place among the pixels to 1/128 px, or what is as little on the
//! array, and cut by the stop where the lenslet is seen by a part of it alone.

use super::axis::Axis;
use super::patch::{self, LANES};
use super::stop::{Line, Parts};
use super::{Footprint, Model, RowSet};
use glam::{DVec2, Vec4};

/// What [`Footprint::through_lenslets`] needs for the slice it is in; one a thread.
#[derive(Debug, Default)]
pub struct Lenslets {
    slice: Option<Slice>,
    wanted: Option<RowSet>,
    /// For each row the first wanted from there on.
    next: Vec<u32>,
    parts: Vec<Parts>,
    cut: Vec<f32>,
}

/// The optics of a slice.
#[derive(Debug, Clone, Copy)]
struct Slice {
    z: usize,
    axis: Axis,
    /// mm of the array a pixel, never 0.
    step_mm: f64,
    /// px a mm of aperture, falling.
    slope: f64,
    per_slope: f64,
    per_alpha: f64,
    /// Half the stop, mm.
    half: f32,
    /// Half its beam on the array, mm.
    spread: f64,
    /// 1 / (a pixel's width), 1/mm.
    per_pixel: f64,
    /// Where a patch's middle lies, px a mm of the chief ray's place and of the lenslet's centre.
    by_chief: f64,
    by_centre: f64,
    /// Half sides of the cell, and these and the blur, mm.
    corner: DVec2,
    reach: DVec2,
    /// From mm^2 of the array to the share of the light.
    scale: f32,
}

/// A share of the blur beyond a cell's edge that decides whether a lenslet is wholly inside the stop: what little light is
/// farther out is not cut.
const BLUR_INSIDE: f64 = 0.4;

impl Slice {
    fn new(footprint: &Footprint, z: usize) -> Self {
        let axis = footprint.axis(z, footprint.width);
        let (_, slope) = axis.line(0.0, 0.0);
        let corner = footprint.corner();
        let blur = DVec2::new(footprint.blur(&axis, 0).reach(), footprint.blur(&axis, 1).reach());
        let step_mm = patch::step_mm(axis.alpha / slope, 2.0 * (corner + blur).max_element());
        // The spread that this step has, not 0 even in focus, with the sign of the true one.
        let alpha = (step_mm * slope.abs()).copysign(axis.alpha);
        let axis = Axis { alpha, ..axis };
        let per_pixel = 1.0 / axis.pixel_pitch;
        let whole = 2.0 * axis.half_aperture * alpha;
        Self {
            z,
            step_mm,
            slope,
            per_slope: 1.0 / slope,
            per_alpha: 1.0 / alpha,
            half: axis.half_aperture as f32,
            per_pixel,
            spread: alpha.abs() * axis.half_aperture,
            by_chief: axis.array_gain * per_pixel + slope / alpha,
            by_centre: axis.lenslet_gain * per_pixel - slope / alpha,
            corner,
            reach: corner + blur,
            scale: footprint.scale / (whole * whole) as f32,
            axis,
        }
    }

    /// The parts of the aperture along one axis; `zero` is the pixel edge that U = 0 meets.
    #[inline(always)]
    fn line(&self, zero: f64, beyond: f64, cell: [f64; 2], per_slope: f64) -> Line {
        let [a, b] = cell.map(|edge| (edge - beyond) * self.per_alpha);
        Line { zero: zero as f32, per_slope: per_slope as f32, low: a.min(b) as f32, high: a.max(b) as f32 }
    }

    /// First pixel of the stop's image and the one behind its last, of pixels cut in so many parts.
    #[inline(always)]
    fn stop(&self, zero: f64, per_px: f64) -> (i32, i32) {
        let half = per_px * self.slope.abs() * self.axis.half_aperture;
        ((zero - half).floor() as i32, (zero + half).floor() as i32 + 1)
    }
}

impl Footprint {
    /// Calls `found(row, first column, share, columns)` for every wanted image row of every lenslet that a voxel lights:
    /// the weights are `share * columns[n]` on pixel `first column + n`. Columns come in fours: up to three behind the
    /// sensor's last have no weight. A pixel may come more than once. For [`Model::Exact`] alone; others go through
    /// [`Footprint::visit`].
    #[inline(always)]
    pub fn through_lenslets(
        &self,
        voxel: [usize; 3],
        lenslets: &mut Lenslets,
        wanted: RowSet,
        mut found: impl FnMut(u32, u32, f32, &[f32]),
    ) {
        debug_assert!(self.model == Model::Exact);
        let z = voxel[2];
        let slice = match &lenslets.slice {
            Some(slice) if slice.z == z => *slice,
            _ => *lenslets.slice.insert(Slice::new(self, z)),
        };
        let Some(array) = &self.array else { return };
        if lenslets.wanted != Some(wanted) {
            lenslets.next = wanted.next_of(self.height);
            lenslets.wanted = Some(wanted);
        }
        let Lenslets { next, parts, cut, .. } = lenslets;
        let patches = self.patches(z, &slice.axis, slice.step_mm);
        let chief = self.chief_mm(&slice.axis, voxel);
        let lattice = self.optics.lattice();
        let (width, height) = (self.width as i32, self.height as i32);
        let middle_px = 0.5 * DVec2::new(f64::from(width), f64::from(height));
        let chief_px = slice.by_chief * chief + middle_px;
        let inside_reach = slice.corner + BLUR_INSIDE * (slice.reach - slice.corner);
        let spread2 = slice.spread * slice.spread;
        let (rows, columns) = (patches.rows as i32, patches.columns);
        for (j, row) in lattice.rows_within(lattice.perfect(chief), slice.reach + DVec2::splat(slice.spread)) {
            let centres = array.row_mm(j, &row);
            let (Some(start), Some(end)) = (centres.first(), centres.last()) else { continue };
            // The image rows that a row of lenslets can light.
            let mut ends = [start.y, end.y];
            if lattice.departs() {
                let ys = centres.iter().map(|centre| centre.y);
                ends = [ys.clone().fold(f64::INFINITY, f64::min), ys.fold(f64::NEG_INFINITY, f64::max)];
            }
            let ends = ends.map(|y| patches.split(chief_px.y + slice.by_centre * y).0);
            let (low, high) = (ends[0].min(ends[1]) - 1, ends[0].max(ends[1]) + rows + 1);
            let (low, high) = (low.max(0), high.min(height));
            if low >= high || next[low as usize] >= high as u32 {
                continue;
            }
            for centre in centres {
                let beyond = chief - *centre;
                let (far_x, far_y) = (beyond.x.abs(), beyond.y.abs());
                let place = chief_px + slice.by_centre * *centre;
                let (first_y, phase_y) = patches.split(place.y);
                let (low, high) = (first_y.max(0), (first_y + rows).min(height));
                if low >= high || next[low as usize] >= high as u32 {
                    continue;
                }
                // Wholly inside the stop: nothing is cut.
                let (x, y) = (far_x + inside_reach.x, far_y + inside_reach.y);
                let is_in = if self.circle { x * x + y * y <= spread2 } else { x <= slice.spread && y <= slice.spread };
                let (first_x, phase_x) = patches.split(place.x);
                let patch = patches.at(phase_x, phase_y);
                if is_in && first_x >= 0 && first_x + columns as i32 <= width {
                    let mut row = next[low as usize];
                    while row < high as u32 {
                        let line = (row as i32 - first_y) as usize * columns;
                        found(row, first_x as u32, slice.scale, &patch[line..line + columns]);
                        row += wanted.step;
                    }
                    continue;
                }
                // Wholly outside.
                let (x, y) = ((far_x - slice.reach.x).max(0.0), (far_y - slice.reach.y).max(0.0));
                let is_out = if self.circle { x * x + y * y > spread2 } else { x > slice.spread || y > slice.spread };
                if is_out {
                    continue;
                }

                let lenslet = Cut { slice: &slice, centre: *centre, chief, place, rows: (low, high) };
                self.through_cut(&lenslet, parts, cut, next, wanted, &mut found);
            }
        }
    }

    /// The weights through a lenslet that the stop cuts or the sensor sees in part. Where the cell's sides are slanted,
    /// pixels are cut in parts.
    #[inline(always)]
    fn through_cut(
        &self,
        lenslet: &Cut,
        parts: &mut Vec<Parts>,
        cut: &mut Vec<f32>,
        next: &[u32],
        wanted: RowSet,
        found: &mut impl FnMut(u32, u32, f32, &[f32]),
    ) {
        let Cut { slice, centre, chief, place, rows: (low, high) } = lenslet;
        let (fine, fineness) = (self.fine_patches(slice.z, &slice.axis, slice.step_mm), self.fineness());
        let per_px = f64::from(fineness);
        let beyond = *chief - *centre;
        let middle_px = 0.5 * DVec2::new(self.width as f64, self.height as f64);
        let zero = (slice.axis.lenslet_gain * *centre + slice.axis.array_gain * *chief) * slice.per_pixel + middle_px;
        let zero = per_px * zero;
        let (first_x, phase_x) = fine.split(per_px * place.x);
        let (first_y, phase_y) = fine.split(per_px * place.y);
        let patch = fine.at(phase_x, phase_y);
        // What the stop lets through and the sensor sees.
        let (stop_x, stop_y) = (slice.stop(zero.x, per_px), slice.stop(zero.y, per_px));
        let left = first_x.max(stop_x.0).max(0);
        let right = (first_x + fine.columns as i32).min(stop_x.1).min(self.width as i32 * fineness);
        let (low_fine, high_fine) = (first_y.max(stop_y.0), (first_y + fine.rows as i32).min(stop_y.1));
        let (low, high) =
            ((*low).max(low_fine.div_euclid(fineness)), (*high).min((high_fine - 1).div_euclid(fineness) + 1));
        if left >= right || low >= high {
            return;
        }
        let first_pixel = left / fineness;
        let pixels = ((right - 1) / fineness + 1 - first_pixel) as usize;
        let count = (right - left) as usize;
        let per_slope = slice.per_slope / per_px;
        let down = slice.line(zero.y, beyond.y, [-slice.corner.y, slice.corner.y], per_slope);
        let behind_all = |parts: &mut Vec<Parts>, cell: [f64; 2]| {
            let across = slice.line(zero.x, beyond.x, cell, per_slope);
            parts.clear();
            for first in (0..count as i32).step_by(LANES) {
                parts.push(across.parts(left + first));
            }
        };
        if self.slabs.len() == 1 {
            behind_all(parts, [-slice.corner.x, slice.corner.x]);
        }
        let mut four = i32::MIN;
        let mut nodes = [Vec4::ZERO; 3];
        let mut middles = Vec4::ZERO;
        let mut row = next[low as usize];
        while row < high as u32 {
            cut.clear();
            cut.resize(pixels.next_multiple_of(LANES), 0.0);
            let start = row as i32 * fineness;
            for fine_row in start.max(low_fine)..(start + fineness).min(high_fine) {
                // The parts of the aperture behind this row, of four at once.
                let lane = (fine_row - first_y) as usize % LANES;
                if fine_row - lane as i32 != four {
                    four = fine_row - lane as i32;
                    let behind = down.parts(four);
                    nodes = if self.circle { behind.half_chords(slice.half) } else { [behind.within(slice.half); 3] };
                    middles = behind.middles();
                }
                if self.slabs.len() > 1 {
                    // Slanted sides: another width at each height.
                    let height = beyond.y + slice.axis.alpha * f64::from(middles[lane]);
                    behind_all(parts, self.edges_at(height));
                }
                let nodes = nodes.map(|node| node[lane]);
                let line = (fine_row - first_y) as usize * fine.columns + (left - first_x) as usize;
                let shares = &patch[line..line + count];
                for (n, parts) in parts.iter().enumerate() {
                    let through =
                        if self.circle { parts.within_chords(nodes) } else { nodes[0] * parts.within(slice.half) };
                    let light = padded(&shares[LANES * n..]) * through;
                    if fineness == 1 {
                        light.write_to_slice(&mut cut[LANES * n..]);
                        continue;
                    }
                    for (lane, light) in light.to_array().into_iter().enumerate().take(count - LANES * n) {
                        cut[((left + (LANES * n + lane) as i32) / fineness - first_pixel) as usize] += light;
                    }
                }
            }
            found(row, first_pixel as u32, slice.scale, cut);
            row += wanted.step;
        }
    }
}

/// A lenslet that is cut.
struct Cut<'a> {
    slice: &'a Slice,
    centre: DVec2,
    chief: DVec2,
    /// Where the middle of its image of the voxel is, px.
    place: DVec2,
    /// First image row that may be lit, and the one behind the last.
    rows: (i32, i32),
}

/// The next four, 0 behind the last.
#[inline(always)]
fn padded(shares: &[f32]) -> Vec4 {
    match shares {
        [a, b, c, d, ..] => Vec4::new(*a, *b, *c, *d),
        _ => Vec4::from_array(std::array::from_fn(|n| shares.get(n).copied().unwrap_or(0.0))),
    }
}
