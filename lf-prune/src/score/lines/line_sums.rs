//! Scores for turned and hexagonal lattices, along lines of voxels.
//!
//! Along x, a section's rays from the voxels of a line pass from lenslet to lenslet at an even pace, and through one lenslet
//! they usually meet one pixel (see [`Views`]). So the sums of a line change only where a ray crosses an edge of a cell.
//! The change is noted at the first voxel beyond the edge, and one pass along the line adds up all changes. They are
//! whole numbers, so the order of adding does not matter. The edges of one kind between two rows of lenslets cut the line
//! in even steps.
//!
//! If rounding could move a cut past a voxel, or if the pixel may change within a cell, rays are traced (`traced.rs`). So
//! the sums are those of `rays.rs`, except for the approximation in `tiles.rs`.

use super::cell::{Cell, EDGES, Edge};
use super::views::{SEEN, Views, between, per_step};
use crate::options::Region;
use crate::score::kept::Kept;
use crate::score::levels::Levels;
use glam::DVec2;
use lf_core::grid::Grid;
use lf_core::optics::{Optics, StraightRays};
use lf_core::simd::fastest;
use std::ops::Range;

/// Added to a number, it leaves the nearest whole number in the low bits.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// Rows and lenslets within this share of one beyond a limit are looked at too.
const SLACK: f64 = 1e-6;

/// Edges cut at once.
const LANES: usize = 4;

/// The voxels of a region of a slice, and the lattice in units of voxels as the slice sees it.
pub(super) struct Lines<'a> {
    pub(super) levels: &'a Levels<'a>,
    pub(super) views: &'a Views,
    pub(super) grid: &'a Grid,
    /// The first voxel of the region along x and y. Places along lines, and lines, are counted from it.
    pub(super) first: [usize; 2],
    /// Voxels of the region along x and y.
    shape: [usize; 2],
    pub(super) optics: &'a Optics,
    pub(super) rays: StraightRays,
    /// Rays meet the perfect lattice this far from where straight ones would, mm.
    pub(super) shift_mm: DVec2,
    /// A lenslet's cell.
    pub(super) cell: Cell,
    /// The cells beyond its left edges.
    neighbours: Vec<Neighbour>,
    /// The largest tolerance of a cut.
    pub(super) tolerance: f64,
    /// From lenslet to lenslet of a row.
    along: DVec2,
    /// From row to row.
    across: DVec2,
    /// Lenslets per voxel along x and along y.
    per_along: DVec2,
    /// Rows of lenslets per voxel across the rows.
    per_across: DVec2,
    /// How far a cell reaches across the rows, in rows.
    reach_rows: f64,
    /// Centre of lenslet 0 of row 0 for each section.
    origins: Vec<DVec2>,
    /// Sections that differ along x only, rising.
    alike: Vec<Range<usize>>,
}

/// The cell beyond an edge: the differences of its number and of its row.
struct Neighbour {
    lenslet: i64,
    row: i64,
    /// Voxels between the edges of lenslets of a row.
    step: f64,
    per_step: f64,
}

/// A row of lenslets that a line passes through, for sections that differ along x only.
struct CrossedRow {
    row: i64,
    /// The lenslets that any of the sections' rays may pass through.
    lenslets: Range<i64>,
    /// Centre of lenslet 0 from the line's first voxel; along x, for a section with its origin there.
    centre: DVec2,
    /// For each left edge of a cell: where the edge of lenslet 0 cuts the line, and the lenslets whose edge cuts it.
    cuts: [(f64, Range<i64>); EDGES],
}

/// The places where a line crosses edges of one kind, one after the other.
pub(super) struct Crossings<'a> {
    pub(super) rays: &'a LineRays,
    /// Place of the next.
    cut: f64,
    /// From each to the next.
    step: f64,
    pub(super) tolerance: f64,
    /// (lenslet, row) on either side.
    cells: [(i64, i64); 2],
}

/// One section's rays from one line of voxels.
pub(super) struct LineRays {
    pub(super) y: usize,
    pub(super) section: usize,
}

/// Changes of the sum from voxel to voxel, along a line.
struct Changes {
    /// At the edges of cells.
    edges: Vec<i64>,
    /// At the ends of runs of traced rays.
    runs: Vec<i64>,
}

/// The voxels kept of a region of slice `z`. All rays meet the perfect lattice `shift_mm` from where straight ones would.
pub(crate) fn slice(levels: &Levels, views: &Views, grid: &Grid, z: usize, region: &Region, shift_mm: DVec2) -> Kept {
    let lines = Lines::new(levels, views, grid, z, region, shift_mm);
    let mut kept = Kept::new();
    fastest(
        #[inline(always)]
        || lines.keep(&mut kept),
    );
    kept
}

impl<'a> Lines<'a> {
    fn new(levels: &'a Levels, views: &'a Views, grid: &'a Grid, z: usize, region: &Region, shift_mm: DVec2) -> Self {
        let optics = &views.optics;
        let z_mm = grid.centre_mm(2, z);
        let spacing = DVec2::new(grid.spacing_mm[0], grid.spacing_mm[1]);
        let first = DVec2::new(grid.centre_mm(0, region[0].start), grid.centre_mm(1, region[1].start));
        let voxels_per_mm = -1.0 / (optics.beta(z_mm) * spacing);
        let corners: Vec<DVec2> = optics.lattice().cell_mm().iter().map(|corner| *corner * voxels_per_mm).collect();
        let (along, across) = (views.along_mm() * voxels_per_mm, views.across_mm() * voxels_per_mm);
        let per_across = DVec2::new(-along.y, along.x) / along.perp_dot(across);
        let origin = |section: &DVec2| {
            (views.origin_mm() - optics.alpha(z_mm) * section - shift_mm) * voxels_per_mm - first / spacing
        };
        let cell = Cell::new(&corners);
        let per_along_row = DVec2::new(across.y, -across.x) / along.perp_dot(across);
        let neighbour = |edge: &Edge| Neighbour {
            lenslet: per_along_row.dot(edge.across).round() as i64,
            row: per_across.dot(edge.across).round() as i64,
            step: along.x - edge.slope * along.y,
            per_step: per_step(along.x - edge.slope * along.y),
        };
        let mut end = 0;
        let alike = views.sections_mm.chunk_by(|a, b| a.y == b.y).map(|sections| {
            end += sections.len();
            end - sections.len()..end
        });
        let alike = alike.collect();
        Self {
            levels,
            views,
            grid,
            first: [region[0].start, region[1].start],
            shape: [region[0].len(), region[1].len()],
            rays: optics.straight_rays(z_mm),
            shift_mm,
            neighbours: cell.left.iter().map(neighbour).collect(),
            tolerance: cell.left.iter().fold(0.0, |tolerance: f64, edge| tolerance.max(edge.tolerance)),
            cell,
            along,
            across,
            per_along: DVec2::new(per_step(along.x), per_step(along.y)),
            per_across,
            reach_rows: corners.iter().fold(0.0, |reach: f64, corner| reach.max(per_across.dot(*corner))),
            origins: views.sections_mm.iter().map(origin).collect(),
            alike,
            optics,
        }
    }

    /// Scores line after line and keeps voxels.
    #[inline(always)]
    fn keep(&self, kept: &mut Kept) {
        let [nx, ny] = self.shape;
        let sections = self.origins.len() as u32;
        let least: Vec<i32> = (0..=sections).map(|seen| self.levels.least_sum(seen, sections)).collect();
        let mut changes = Changes { edges: vec![0i64; nx + 1], runs: vec![0i64; nx + 1] };
        let mut crossed = Vec::new();
        for y in 0..ny {
            changes.edges.fill(0);
            changes.runs.fill(0);
            for alike in &self.alike {
                let is_sure = self.cross_rows(y, alike, &mut crossed);
                for section in alike.clone() {
                    let rays = LineRays { y, section };
                    if is_sure {
                        self.note(&rays, &crossed, &mut changes);
                    } else {
                        self.note_all(&rays, &mut changes.runs);
                    }
                }
            }
            changes.edges[0] = 0;
            let mut all = 0;
            for x in 0..nx {
                all += changes.runs[x] + changes.edges[x];
                let seen = (all / SEEN) as u32;
                let sum = -i32::try_from(all % SEEN).unwrap_or(i32::MAX);
                if sum >= least[seen as usize] {
                    let place = (self.first[1] + y) * self.grid.shape[0] + self.first[0] + x;
                    kept.push((place as u32, self.levels.score(sum, seen)));
                }
            }
        }
    }

    /// Centre of lenslet 0 of row 0, from the line's first voxel.
    #[inline(always)]
    fn origin(&self, rays: &LineRays) -> DVec2 {
        self.origins[rays.section] - DVec2::new(0.0, rays.y as f64)
    }

    /// Rows of lenslets that the line may pass through.
    #[inline(always)]
    fn rows(&self, origin: DVec2) -> Range<i64> {
        let at_start = self.per_across.dot(-origin);
        let at_end = at_start + self.per_across.x * self.last_x();
        let reach = self.reach_rows + SLACK;
        let (low, high) = (at_start.min(at_end) - reach, at_start.max(at_end) + reach);
        let known = self.views.rows();
        (low.ceil() as i64).max(known.start)..(high.floor() as i64 + 1).min(known.end)
    }

    /// Lenslets of a row that the line may pass through.
    #[inline(always)]
    fn lenslets(&self, row: i64, centre: DVec2) -> Range<i64> {
        let reach = self.cell.reach + DVec2::splat(SLACK);
        let known = self.views.lenslets(row);
        let by_x = between(centre.x, self.per_along.x, -reach.x, self.last_x() + reach.x);
        let by_y = between(centre.y, self.per_along.y, -reach.y, reach.y);
        let start = (max(by_x.0, by_y.0).ceil() as i64).max(known.start);
        start..(min(by_x.1, by_y.1).floor() as i64 + 1).min(known.end)
    }

    /// The last voxel of a line.
    #[inline(always)]
    pub(super) fn last_x(&self) -> f64 {
        (self.shape[0] - 1) as f64
    }

    /// Finds the rows of lenslets that a line's rays through alike sections cross. False if the rays pass so near a corner of
    /// a cell that rounding decides on which side.
    #[inline(always)]
    fn cross_rows(&self, y: usize, alike: &Range<usize>, crossed: &mut Vec<CrossedRow>) -> bool {
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

    /// Notes the light of one section's rays.
    #[inline(always)]
    fn note(&self, rays: &LineRays, crossed: &[CrossedRow], changes: &mut Changes) {
        let nearest = self.optics.lattice().nearest_centre_mm(self.array_mm(rays, 0));
        changes.runs[0] += self.views.light(rays.section, self.views.lenslet(nearest));
        let origin_x = self.origins[rays.section].x;
        for CrossedRow { row, lenslets, centre, cuts } in crossed {
            for (n, (cut, lenslets)) in cuts.iter().enumerate() {
                if !lenslets.is_empty() {
                    self.cross_edges(rays, *row, n, origin_x + cut, lenslets, &mut changes.edges);
                }
            }
            let several = self.views.several(rays.section, *row);
            let first = several.partition_point(|lenslet| *lenslet < lenslets.start);
            for lenslet in several[first..].iter().take_while(|lenslet| **lenslet < lenslets.end) {
                let centre = DVec2::new(origin_x, 0.0) + *centre + *lenslet as f64 * self.along;
                self.note_several(rays, centre, (*lenslet, *row), &mut changes.runs);
            }
        }
    }

    /// Notes the changes at the left edges number `n` of a row of lenslets; lenslet 0 has its edge at `cut`.
    #[inline(always)]
    fn cross_edges(&self, rays: &LineRays, row: i64, n: usize, cut: f64, lenslets: &Range<i64>, edges: &mut [i64]) {
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
                voxel = self.first_beyond(crossings, places[n] - 0.5, voxel, cells);
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

#[inline(always)]
fn max(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn min(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}
