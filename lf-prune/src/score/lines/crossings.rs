//! Where a line of voxels crosses the edges of cells.

use super::lattice_lines::{LineRays, Lines, max, min};
use super::{cell::EDGES, views::between};
use glam::DVec2;
use std::ops::Range;

/// Added to a number, it leaves the nearest whole number in the low bits.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// Edges cut at once.
const LANES: usize = 4;

/// A row of lenslets that a line passes through, for sections that differ along x only.
pub(super) struct CrossedRow {
    pub(super) row: i64,
    /// The lenslets that any of the sections' rays may pass through.
    pub(super) lenslets: Range<i64>,
    /// Centre of lenslet 0 from the line's first voxel; along x, for a section with its origin there.
    pub(super) centre: DVec2,
    /// For each left edge of a cell: where the edge of lenslet 0 cuts the line, and the lenslets whose edge cuts it.
    pub(super) cuts: [(f64, Range<i64>); EDGES],
}

/// Where a line crosses edges of one kind, one after the other.
struct Crossings<'a> {
    rays: &'a LineRays,
    /// Place of the next.
    cut: f64,
    /// From each to the next.
    step: f64,
    tolerance: f64,
    /// (lenslet, row) on either side.
    cells: [(i64, i64); 2],
}

impl Lines<'_> {
    /// Finds the rows of lenslets that a line's rays through alike sections cross. False if rounding decides on which
    /// side of a cell's corner they pass.
    #[inline(always)]
    pub(super) fn cross_rows(&self, y: usize, alike: &Range<usize>, crossed: &mut Vec<CrossedRow>) -> bool {
        crossed.clear();
        let ends = [alike.start, alike.end - 1].map(|section| self.origin(&LineRays { y, section }));
        for row in both(self.rows(ends[0]), self.rows(ends[1])) {
            let centres = ends.map(|origin| origin + row as f64 * self.across);
            let lenslets = both(self.lenslets(row, centres[0]), self.lenslets(row, centres[1]));
            if lenslets.is_empty() {
                continue;
            }
            let centre = DVec2::new(row as f64 * self.across.x, centres[0].y);
            let (first, last) = (lenslets.start as f64, (lenslets.end - 1) as f64);
            let is_near_corner = |corner: f64| {
                let lenslet = (-corner - centre.y) * self.per_along.y;
                let lenslet = min(max((lenslet + 0.5).floor(), first), last);
                (centre.y + lenslet * self.along.y + corner).abs() < self.cell.tolerance
            };
            let mut cuts = [const { (0.0, 0..0) }; EDGES];
            // The corners at the right of a cell are those at the left of its neighbours.
            for (edge, cut) in self.cell.left.iter().zip(&mut cuts) {
                if is_near_corner(edge.low) || is_near_corner(edge.high) {
                    return false;
                }
                let by_y = between(centre.y, self.per_along.y, -edge.high, -edge.low);
                let start = (by_y.0.ceil() as i64).max(lenslets.start);
                let end = (by_y.1.floor() as i64 + 1).min(lenslets.end);
                *cut = (centre.x - edge.slope * centre.y + edge.at, start..end);
            }
            crossed.push(CrossedRow { row, lenslets, centre, cuts });
        }
        true
    }

    /// Notes the changes at the left edges number `n` of a row of lenslets; lenslet 0 has its edge at `cut`.
    #[inline(always)]
    pub(super) fn cross_edges(
        &self,
        rays: &LineRays,
        row: i64,
        n: usize,
        cut: f64,
        lenslets: &Range<i64>,
        edges: &mut [i64],
    ) {
        let (edge, neighbour) = (&self.cell.left[n], &self.neighbours[n]);
        let by_x = between(cut, neighbour.per_step, -0.4, self.last_x() + 0.4);
        let start = (by_x.0.ceil() as i64).max(lenslets.start);
        let end = (by_x.1.floor() as i64 + 1).min(lenslets.end);
        if start >= end {
            return;
        }
        let (beyond, beyond_row) = (neighbour.lenslet, row + neighbour.row);
        let old = self.views.lights(rays.section, beyond_row, start + beyond..end + beyond);
        let new = self.views.lights(rays.section, row, start..end);
        let mut crossings = Crossings {
            rays,
            cut: cut + start as f64 * neighbour.step,
            step: neighbour.step,
            tolerance: edge.tolerance,
            cells: [(start + beyond, beyond_row), (start, row)],
        };
        let (new, old) = (new.chunks_exact(LANES), old.chunks_exact(LANES));
        let rest = new.remainder().iter().zip(old.remainder());
        for (new, old) in new.zip(old) {
            self.cross::<LANES>(&mut crossings, std::array::from_fn(|n| new[n] - old[n]), edges);
        }
        for (new, old) in rest {
            self.cross::<1>(&mut crossings, [new - old], edges);
        }
    }

    /// Notes the changes at the next N crossings, each at the first voxel beyond.
    #[inline(always)]
    fn cross<const N: usize>(&self, crossings: &mut Crossings, changes: [i64; N], edges: &mut [i64]) {
        let places: [f64; N] = std::array::from_fn(|n| crossings.cut + n as f64 * crossings.step + 0.5);
        let rounded = places.map(|place| place + WHOLE);
        let mut is_sure = true;
        for n in 0..N {
            is_sure &= ((rounded[n] - WHOLE) - places[n]).abs() <= 0.5 - crossings.tolerance;
        }
        for n in 0..N {
            let mut voxel = rounded[n].to_bits() as u32 as usize;
            if !is_sure {
                let cells = crossings.cells.map(|(lenslet, row)| (lenslet + n as i64, row));
                voxel = self.first_beyond(crossings.rays, crossings.tolerance, places[n] - 0.5, voxel, cells);
            }
            if let Some(change) = edges.get_mut(voxel) {
                *change += changes[n];
            }
        }
        crossings.cut += N as f64 * crossings.step;
        crossings.cells = crossings.cells.map(|(lenslet, row)| (lenslet + N as i64, row));
    }
}

/// The smallest range that holds two.
#[inline(always)]
fn both(a: Range<i64>, b: Range<i64>) -> Range<i64> {
    a.start.min(b.start)..a.end.max(b.end)
}
