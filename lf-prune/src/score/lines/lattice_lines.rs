//! The lattice as a line of voxels sees it, in units of voxels.

use super::cell::{Cell, Edge};
use super::views::{Views, between, per_step};
use crate::score::{levels::Levels, slice::Slice};
use glam::DVec2;
use lf_core::{Grid, Optics, optics::StraightRays};
use std::ops::Range;

/// Rows and lenslets within this share of one beyond a limit are looked at too.
const SLACK: f64 = 1e-6;

/// The voxels of a region of a slice, and the lattice as the slice sees it, in units of voxels.
pub(super) struct Lines<'a> {
    pub(super) levels: &'a Levels<'a>,
    pub(super) views: &'a Views,
    pub(super) grid: &'a Grid,
    /// The region's first voxel along x and y. Lines, and places along them, are counted from it.
    pub(super) first: [usize; 2],
    /// Voxels of the region along x and y.
    pub(super) shape: [usize; 2],
    pub(super) optics: &'a Optics,
    pub(super) rays: StraightRays,
    /// Rays meet the perfect lattice this far from where straight ones would, mm.
    pub(super) shift_mm: DVec2,
    pub(super) cell: Cell,
    /// Beyond its left edges.
    pub(super) neighbours: Vec<Neighbour>,
    /// The largest tolerance of a cut.
    pub(super) tolerance: f64,
    /// From lenslet to lenslet of a row.
    pub(super) along: DVec2,
    /// From row to row.
    pub(super) across: DVec2,
    /// Lenslets per voxel along x and along y.
    pub(super) per_along: DVec2,
    /// Rows of lenslets per voxel across the rows.
    per_across: DVec2,
    /// How far a cell reaches across the rows, in rows.
    reach_rows: f64,
    /// Centre of lenslet 0 of row 0 for each section.
    pub(super) origins: Vec<DVec2>,
    /// Sections that differ along x only, rising.
    pub(super) alike: Vec<Range<usize>>,
}

/// The cell beyond an edge: the differences of its number and of its row.
pub(super) struct Neighbour {
    pub(super) lenslet: i64,
    pub(super) row: i64,
    /// Voxels between the edges of lenslets of a row.
    pub(super) step: f64,
    pub(super) per_step: f64,
}

/// One section's rays from one line of voxels.
pub(super) struct LineRays {
    pub(super) y: usize,
    pub(super) section: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(slice: &Slice<'a>, views: &'a Views, shift_mm: DVec2) -> Self {
        let Slice { levels, grid, z, region, .. } = *slice;
        let optics = &views.optics;
        let z_mm = grid.centre_mm(2, z);
        let spacing = DVec2::new(grid.spacing_mm[0], grid.spacing_mm[1]);
        let first = DVec2::new(grid.centre_mm(0, region[0].start), grid.centre_mm(1, region[1].start));
        // With their signs: from voxel to voxel a ray moves to the right and to the top of the picture.
        let voxels_per_mm = 1.0 / optics.straight_rays(z_mm).chief_mm(spacing);
        let corners: Vec<DVec2> = optics.lattice().cell_mm().iter().map(|corner| *corner * voxels_per_mm).collect();
        let (along, across) = (views.lattice.along_mm * voxels_per_mm, views.lattice.across_mm * voxels_per_mm);
        let per_across = DVec2::new(-along.y, along.x) / along.perp_dot(across);
        let origin = |section: &DVec2| {
            (views.lattice.origin_mm - optics.alpha(z_mm) * section - shift_mm) * voxels_per_mm - first / spacing
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
            alike: alike.collect(),
            optics,
        }
    }

    /// Centre of lenslet 0 of row 0, from the line's first voxel.
    #[inline(always)]
    pub(super) fn origin(&self, rays: &LineRays) -> DVec2 {
        self.origins[rays.section] - DVec2::new(0.0, rays.y as f64)
    }

    /// Rows of lenslets that the line may pass through.
    #[inline(always)]
    pub(super) fn rows(&self, origin: DVec2) -> Range<i64> {
        let at_start = self.per_across.dot(-origin);
        let at_end = at_start + self.per_across.x * self.last_x();
        let reach = self.reach_rows + SLACK;
        let (low, high) = (at_start.min(at_end) - reach, at_start.max(at_end) + reach);
        let known = self.views.rows();
        (low.ceil() as i64).max(known.start)..(high.floor() as i64 + 1).min(known.end)
    }

    /// Lenslets of a row that the line may pass through.
    #[inline(always)]
    pub(super) fn lenslets(&self, row: i64, centre: DVec2) -> Range<i64> {
        let reach = self.cell.reach + DVec2::splat(SLACK);
        let known = self.views.lenslets(row);
        let by_x = between(centre.x, self.per_along.x, -reach.x, self.last_x() + reach.x);
        let by_y = between(centre.y, self.per_along.y, -reach.y, reach.y);
        let start = (max(by_x.0, by_y.0).ceil() as i64).max(known.start);
        start..(min(by_x.1, by_y.1).floor() as i64 + 1).min(known.end)
    }

    #[inline(always)]
    pub(super) fn last_x(&self) -> f64 {
        (self.shape[0] - 1) as f64
    }
}

#[inline(always)]
pub(super) fn max(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(super) fn min(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}
