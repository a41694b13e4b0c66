//! Scores for turned and hexagonal lattices, along lines of voxels.
//!
//! Along x, a section's rays from the voxels of a line pass from lenslet to lenslet at an even pace, and through one
//! lenslet they usually meet one pixel (see [`Views`]). So the sums of a line change only where a ray crosses an edge
//! of a cell; edges of one kind between two rows of lenslets cut the line in even steps. The change is noted at the
//! first voxel beyond, and one pass along the line adds up all changes: whole numbers, in any order.
//!
//! If rounding could move a cut past a voxel, or if the pixel may change within a cell, rays are traced (`traced.rs`).
//! So the sums are those of `rays.rs`, except for the approximation in `tiles.rs`.

use super::crossings::CrossedRow;
use super::lattice_lines::{LineRays, Lines};
use super::views::{SEEN, Views};
use crate::score::slice::{Kept, Slice};
use glam::DVec2;
use lf_core::simd::fastest;

/// Changes of the sum from voxel to voxel, along a line.
struct Changes {
    /// At the edges of cells.
    edges: Vec<i64>,
    /// At the ends of runs of traced rays.
    runs: Vec<i64>,
}

/// The voxels kept. All rays meet the perfect lattice `shift_mm` from where straight ones would.
pub(crate) fn slice(slice: &Slice, views: &Views, shift_mm: DVec2) -> Kept {
    let lines = Lines::new(slice, views, shift_mm);
    let mut kept = Kept::new();
    fastest(
        #[inline(always)]
        || lines.keep(&mut kept),
    );
    kept
}

impl Lines<'_> {
    #[inline(always)]
    fn keep(&self, kept: &mut Kept) {
        let [nx, ny] = self.shape;
        let sections = self.origins.len() as u32;
        let least: Vec<i32> = (0..=sections).map(|seen| self.levels.least_sum(seen, sections)).collect();
        let mut changes = Changes { edges: vec![0; nx + 1], runs: vec![0; nx + 1] };
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
                        self.note_rays(&rays, None, (0.0, self.last_x()), &mut changes.runs);
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
            let mixed = self.views.mixed(rays.section, *row);
            let first = mixed.partition_point(|lenslet| *lenslet < lenslets.start);
            for lenslet in mixed[first..].iter().take_while(|lenslet| **lenslet < lenslets.end) {
                let centre = DVec2::new(origin_x, 0.0) + *centre + *lenslet as f64 * self.along;
                self.note_mixed(rays, centre, (*lenslet, *row), &mut changes.runs);
            }
        }
    }
}
