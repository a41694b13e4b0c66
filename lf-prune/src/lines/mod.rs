//! Scores for turned and hexagonal lattices, along lines of voxels.
//!
//! Along x, a section's rays from the voxels of a line pass from lenslet to lenslet at an even pace, and through one
//! lenslet they meet one pixel (see [`crate::views`]). So a line's sums change only where a ray passes an edge of a cell:
//! the change is noted at the first voxel beyond, and one pass along the line adds all notes up, in whole numbers, which no
//! order of adding can alter. The edges of one kind between two rows of lenslets cut the line in even steps. Where rounding
//! could move a cut past a voxel, or the pixel may change within a cell, rays are traced, so the sums are those of
//! [`crate::scattered`], but for what [`tiles`] do.

mod rays;
mod tiles;

use crate::cell::{Cell, EDGES, Edge};
use crate::views::{SEEN, Views, between, per_step};
use crate::{Levels, Part, Slice};
use glam::DVec2;
use lf_core::camera::Camera;
use lf_core::grid::Grid;
use lf_core::optics::Optics;
use lf_core::simd::fastest;
use std::ops::Range;

/// Added to a number, it leaves its nearest whole one in the low bits.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// Rows and lenslets within this share of one are looked at too.
const SLACK: f64 = 1e-6;

/// Edges cut at once.
const LANES: usize = 4;

/// One slice's voxels, and the lattice in voxels as the slice sees it.
struct Lines<'a> {
    levels: &'a Levels<'a>,
    views: &'a Views,
    grid: &'a Grid,
    /// The first of the voxels looked at, along x and y, and their number; places along lines and lines count from it.
    first: [usize; 2],
    shape: [usize; 2],
    optics: &'a Optics,
    /// A ray meets the perfect lattice at -beta X + alpha U + shift.
    shift_mm: DVec2,
    alpha: f64,
    beta: f64,
    pixels_per_mm: f64,
    /// A lenslet's cell, in voxels.
    cell: Cell,
    /// The cells beyond its left edges.
    neighbours: Vec<Neighbour>,
    /// Voxels this near any cut are in the one cell or in the other.
    unsure: f64,
    /// From lenslet to lenslet and from row to row, in voxels.
    along: DVec2,
    across: DVec2,
    /// Lenslets for a voxel along x and along y.
    per_along: DVec2,
    /// Rows of lenslets for a voxel across the rows.
    per_across: DVec2,
    /// How far a cell reaches across the rows, in rows.
    reach_rows: f64,
    /// Centre of lenslet 0 of row 0 for each section, in voxels.
    origins: Vec<DVec2>,
    /// Sections that differ along x alone, rising.
    alike: Vec<Range<usize>>,
}

/// The cell beyond an edge, by how far its number and its row are off.
struct Neighbour {
    lenslet: i64,
    row: i64,
    /// Voxels between the edges of lenslets of a row, and the inverse.
    step: f64,
    per_step: f64,
}

/// A row of lenslets that a line passes through, for sections that differ along x alone.
struct Passage {
    row: i64,
    /// The lenslets that any of the sections' rays may pass through.
    lenslets: Range<i64>,
    /// Centre of lenslet 0, from the line's first voxel; along x, for a section whose origin is there.
    centre: DVec2,
    /// For each left edge of a cell: where that of lenslet 0 cuts the line, and the lenslets whose edge cuts it.
    cuts: [(f64, Range<i64>); EDGES],
}

/// Where a line passes from lenslets of one row to their neighbours.
struct Turning<'a> {
    section: &'a Section,
    /// Place of the next of them, and from each to the one after, in voxels.
    cut: f64,
    step: f64,
    unsure: f64,
    /// The cells on either side.
    cells: [(i64, i64); 2],
}

/// One section's rays from one line of voxels.
struct Section {
    y: usize,
    section: usize,
}

/// The voxels of a part of a slice that are kept, with their scores.
pub(crate) fn slice(levels: &Levels, camera: &Camera, views: &Views, grid: &Grid, z: usize, part: &Part) -> Slice {
    if camera.centres.is_some() || camera.distortion.is_some() {
        return tiles::slice(levels, camera, views, grid, z, part);
    }
    shifted(levels, views, grid, z, part, DVec2::ZERO)
}

/// The same where all rays meet the perfect lattice `shift_mm` beside where straight ones would.
fn shifted(levels: &Levels, views: &Views, grid: &Grid, z: usize, part: &Part, shift_mm: DVec2) -> Slice {
    let lines = Lines::new(levels, views, grid, z, part, shift_mm);
    let mut kept = Slice::new();
    fastest(
        #[inline(always)]
        || lines.keep(&mut kept),
    );
    kept
}

impl<'a> Lines<'a> {
    fn new(levels: &'a Levels, views: &'a Views, grid: &'a Grid, z: usize, part: &Part, shift_mm: DVec2) -> Self {
        let optics = &views.optics;
        let z_mm = grid.centre_mm(2, z);
        let spacing = DVec2::new(grid.spacing_mm[0], grid.spacing_mm[1]);
        let first = DVec2::new(grid.centre_mm(0, part[0].start), grid.centre_mm(1, part[1].start));
        let voxels_per_mm = -1.0 / (optics.beta(z_mm) * spacing);
        let corners: Vec<DVec2> = optics.lattice().cell_mm().iter().map(|corner| *corner * voxels_per_mm).collect();
        let (along, across) = (views.along_mm * voxels_per_mm, views.across_mm * voxels_per_mm);
        let per_across = DVec2::new(-along.y, along.x) / along.perp_dot(across);
        let origin = |section: &DVec2| {
            (views.origin_mm - optics.alpha(z_mm) * section - shift_mm) * voxels_per_mm - first / spacing
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
            first: [part[0].start, part[1].start],
            shape: [part[0].len(), part[1].len()],
            shift_mm,
            alpha: optics.alpha(z_mm),
            beta: optics.beta(z_mm),
            pixels_per_mm: 1.0 / optics.pixel_pitch_mm(),
            neighbours: cell.left.iter().map(neighbour).collect(),
            unsure: cell.left.iter().fold(0.0, |unsure: f64, edge| unsure.max(edge.unsure)),
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

    #[inline(always)]
    fn keep(&self, kept: &mut Slice) {
        let [nx, ny] = self.shape;
        let sections = self.origins.len() as u32;
        let least: Vec<i32> = (0..=sections).map(|seen| self.levels.least_sum(seen, sections)).collect();
        // What changes from voxel to voxel where rays pass from cell to cell, and what runs add and take back.
        let mut turns = vec![0i64; nx + 1];
        let mut notes = vec![0i64; nx + 1];
        let mut passages = Vec::new();
        for y in 0..ny {
            turns.fill(0);
            notes.fill(0);
            for alike in &self.alike {
                let sure = self.pass(y, alike, &mut passages);
                for section in alike.clone() {
                    let section = Section { y, section };
                    if sure {
                        self.note(&section, &passages, &mut turns, &mut notes);
                    } else {
                        self.note_all(&section, &mut notes);
                    }
                }
            }
            turns[0] = 0;
            let mut all = 0;
            for x in 0..nx {
                all += notes[x] + turns[x];
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
    fn origin(&self, section: &Section) -> DVec2 {
        self.origins[section.section] - DVec2::new(0.0, section.y as f64)
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

    #[inline(always)]
    fn last_x(&self) -> f64 {
        (self.shape[0] - 1) as f64
    }

    /// The rows that a line's rays through sections alike pass through. False where they pass a corner of a cell so near
    /// that they may pass it on either side.
    #[inline(always)]
    fn pass(&self, y: usize, alike: &Range<usize>, passages: &mut Vec<Passage>) -> bool {
        passages.clear();
        let ends = [alike.start, alike.end - 1].map(|section| self.origin(&Section { y, section }));
        for row in both(self.rows(ends[0]), self.rows(ends[1])) {
            let centres = ends.map(|origin| origin + row as f64 * self.across);
            let lenslets = both(self.lenslets(row, centres[0]), self.lenslets(row, centres[1]));
            if lenslets.is_empty() {
                continue;
            }
            let centre = DVec2::new(row as f64 * self.across.x, centres[0].y);
            let (first, last) = (lenslets.start as f64, (lenslets.end - 1) as f64);
            let near_corner = |corner: f64| {
                let lenslet = (-corner - centre.y) * self.per_along.y;
                let lenslet = min(max((lenslet + 0.5).floor(), first), last);
                (centre.y + lenslet * self.along.y + corner).abs() < self.cell.unsure
            };
            let mut cuts = [const { (0.0, 0..0) }; EDGES];
            // Corners at the right are those of neighbours at the left.
            for (edge, cut) in self.cell.left.iter().zip(&mut cuts) {
                if near_corner(edge.low) || near_corner(edge.high) {
                    return false;
                }
                let by_y = between(centre.y, self.per_along.y, -edge.high, -edge.low);
                let start = (by_y.0.ceil() as i64).max(lenslets.start);
                let end = (by_y.1.floor() as i64 + 1).min(lenslets.end);
                *cut = (centre.x - edge.slope * centre.y + edge.at, start..end);
            }
            passages.push(Passage { row, lenslets, centre, cuts });
        }
        true
    }

    /// Notes the light of one section's rays.
    #[inline(always)]
    fn note(&self, section: &Section, passages: &[Passage], turns: &mut [i64], notes: &mut [i64]) {
        let nearest = self.optics.lattice().nearest_centre_mm(self.array_mm(section, 0));
        notes[0] += self.views.light(section.section, self.views.lenslet(nearest));
        let origin_x = self.origins[section.section].x;
        for Passage { row, lenslets, centre, cuts } in passages {
            for (n, (cut, lenslets)) in cuts.iter().enumerate() {
                if lenslets.is_empty() {
                    continue;
                }
                let (edge, neighbour) = (&self.cell.left[n], &self.neighbours[n]);
                let cut = origin_x + cut;
                let by_x = between(cut, neighbour.per_step, -0.4, self.last_x() + 0.4);
                let start = (by_x.0.ceil() as i64).max(lenslets.start);
                let end = (by_x.1.floor() as i64 + 1).min(lenslets.end);
                if start >= end {
                    continue;
                }
                let (beyond, beyond_row) = (neighbour.lenslet, row + neighbour.row);
                let old = self.views.lights(section.section, beyond_row, start + beyond..end + beyond);
                let new = self.views.lights(section.section, *row, start..end);
                let mut turning = Turning {
                    section,
                    cut: cut + start as f64 * neighbour.step,
                    step: neighbour.step,
                    unsure: edge.unsure,
                    cells: [(start + beyond, beyond_row), (start, *row)],
                };
                let (new, old) = (new.chunks_exact(LANES), old.chunks_exact(LANES));
                let rest = new.remainder().iter().zip(old.remainder());
                for (new, old) in new.zip(old) {
                    self.turn::<LANES>(&mut turning, std::array::from_fn(|n| new[n] - old[n]), turns);
                }
                for (new, old) in rest {
                    self.turn::<1>(&mut turning, [new - old], turns);
                }
            }
            let several = self.views.several(section.section, *row);
            let first = several.partition_point(|lenslet| *lenslet < lenslets.start);
            for lenslet in several[first..].iter().take_while(|lenslet| **lenslet < lenslets.end) {
                let centre = DVec2::new(origin_x, 0.0) + *centre + *lenslet as f64 * self.along;
                self.note_several(section, centre, (*lenslet, *row), notes);
            }
        }
    }

    /// Notes what changes where a line passes from cells to their neighbours.
    #[inline(always)]
    fn turn<const N: usize>(&self, turning: &mut Turning, changes: [i64; N], turns: &mut [i64]) {
        let places: [f64; N] = std::array::from_fn(|n| turning.cut + n as f64 * turning.step + 0.5);
        let rounded = places.map(|place| place + WHOLE);
        let mut sure = true;
        for n in 0..N {
            sure &= ((rounded[n] - WHOLE) - places[n]).abs() <= 0.5 - turning.unsure;
        }
        for n in 0..N {
            let mut voxel = rounded[n].to_bits() as u32 as usize;
            if !sure {
                let cells = turning.cells.map(|(lenslet, row)| (lenslet + n as i64, row));
                voxel = self.first_beyond(turning, places[n] - 0.5, voxel, cells);
            }
            if let Some(turn) = turns.get_mut(voxel) {
                *turn += changes[n];
            }
        }
        turning.cut += N as f64 * turning.step;
        turning.cells = turning.cells.map(|(lenslet, row)| (lenslet + N as i64, row));
    }
}

/// The least range that holds two.
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
