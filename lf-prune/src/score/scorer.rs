//! Scores the voxels of a slice, one group of lenslets after the other.

use super::cells::Cells;
use super::chiefs::{Chiefs, FRACTION, Line, SliceRays};
use super::sections::Sections;
use super::shades::Shades;
use super::sums::{LANES, sums};
use super::views::{Plan, Views};
use super::walk::{Raster, Walk};
use super::walks::Walks;
use crate::options::Region;
use glam::DVec2;
use lf_core::{Camera, Grid, Optics, simd};

/// Voxels of a slice as (x + nx y, score), rising.
pub(crate) type Kept = Vec<(u32, f32)>;

/// Voxels from place to place of the raster, at most.
const PLACES_PER_VOXEL: f64 = 4.0;
/// Least and most bits of the raster along a side of the lattice's cell. The coordinates of a voxel within a group of
/// lenslets must fit 32 bits.
const RASTER_BITS: [u32; 2] = [3, u32::BITS - FRACTION - LANES.ilog2()];

/// Scores slices of voxels against an image.
pub(crate) struct Scorer<'a> {
    camera: &'a Camera,
    grid: &'a Grid,
    shades: &'a Shades<'a>,
    optics: Optics,
    cells: Cells,
    sections_mm: Vec<DVec2>,
    views: Views,
    raster: Raster,
    /// Largest sum of shades of a voxel that is kept, for each number of rays that meet the sensor.
    most: Vec<i32>,
    /// Score of each sum up to the largest, if all rays meet the sensor.
    scores: Vec<f32>,
}

/// Neighbouring voxels of a line whose chief rays meet one group of lenslets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Run {
    /// Row of lenslets, and group along the row.
    row: u32,
    group: u32,
    y: u32,
    x: u32,
    end: u32,
}

/// Sums of the voxels of one group of lenslets at every place of the raster.
struct Sums {
    shades: Vec<u16>,
    /// Rays that meet the sensor.
    seen: Vec<u16>,
    /// Places in the sums of a run's voxels.
    places: Vec<u32>,
}

/// The raster for a slice of voxels: a voxel is scored at a place that is at most an eighth of a voxel from its centre
/// along each side of the lattice.
fn raster(rays: &SliceRays) -> Raster {
    let [along_x, along_y] = rays.per_voxel();
    let area = along_x.perp_dot(along_y);
    // Voxels that a step of one cell passes.
    let voxels = [DVec2::X, DVec2::Y].map(|side| DVec2::new(side.perp_dot(along_y), along_x.perp_dot(side)) / area);
    let bits = |voxels: DVec2| (PLACES_PER_VOXEL * voxels.abs().max_element()).log2().ceil() as i32;
    let [least, most] = RASTER_BITS.map(|bits| bits as i32);
    Raster { bits: voxels.map(|voxels| bits(voxels).clamp(least, most) as u32) }
}

impl<'a> Scorer<'a> {
    pub(crate) fn new(
        shades: &'a Shades<'a>,
        sections: &Sections,
        camera: &'a Camera,
        grid: &'a Grid,
        plan: &Plan,
    ) -> Self {
        let (optics, cells) = (Optics::new(camera), Cells::new(camera));
        let z_mm = grid.centre_mm(2, grid.shape[2] / 2);
        let raster = raster(&SliceRays { optics: &optics, cells: &cells, grid, z_mm });
        let count = sections.count();
        let most: Vec<i32> = (0..=count).map(|seen| shades.most(seen, count).min(i32::from(u16::MAX))).collect();
        let scores = (0..=most[count as usize]).map(|sum| shades.score(sum as u32, count)).collect();
        let views = Views::new(plan, shades, sections, camera);
        let sections_mm = sections.traced_mm();
        Self { camera, grid, shades, optics, cells, sections_mm, views, raster, most, scores }
    }

    fn rays(&self, z: usize) -> SliceRays<'_> {
        let z_mm = self.grid.centre_mm(2, z);
        SliceRays { optics: &self.optics, cells: &self.cells, grid: self.grid, z_mm }
    }

    /// The voxels kept of a region of slice `z`.
    pub(crate) fn slice(&self, z: usize, region: &Region) -> Kept {
        let rays = self.rays(z);
        let (origin, _) = self.views.plan.voxel_lenslets();
        let chiefs = Chiefs::new(&rays, self.camera, self.raster, origin);
        let mut walks = Walks::new(&rays, self.camera, &self.sections_mm, self.raster, &self.views.plan);
        let size = self.raster.places() * LANES;
        let mut sums = Sums { shades: vec![0; size], seen: vec![0; size], places: Vec::new() };
        let mut kept = Kept::new();
        for runs in self.runs(&chiefs, region).chunk_by(|a, b| (a.row, a.group) == (b.row, b.group)) {
            let walk = walks.of(runs[0].row as usize, runs[0].group as usize);
            self.keep(runs, &chiefs, walk, &mut sums, &mut kept);
        }
        kept.sort_unstable_by_key(|(place, _)| *place);
        kept
    }

    /// The voxels of a region whose rays may meet the sensor, by row and group of lenslets.
    fn runs(&self, chiefs: &Chiefs, region: &Region) -> Vec<Run> {
        let (_, [groups, rows]) = self.views.plan.voxel_lenslets();
        let [x_bits, y_bits] = self.raster.bits;
        // Bits of a coordinate within a group of lenslets, and within a row.
        let bits = [FRACTION + x_bits + LANES.ilog2(), FRACTION + y_bits];
        let mut runs = Vec::new();
        for y in region[1].clone() {
            let mut x = region[0].start;
            while x < region[0].end {
                let line = chiefs.line(x, y);
                let line_end = chiefs.line_end(x).min(region[0].end);
                while x < line_end {
                    let end = run_end(&line, bits, x, line_end);
                    let [group, row] = [0, 1].map(|axis| line.at(axis, x) >> bits[axis]);
                    if (0..groups as i64).contains(&group) && (0..rows as i64).contains(&row) {
                        let [x, end, y] = [x, end, y].map(|place| place as u32);
                        runs.push(Run { row: row as u32, group: group as u32, y, x, end });
                    }
                    x = end;
                }
            }
        }
        runs.sort_unstable();
        runs
    }

    /// Whether all rays of the voxels of runs meet the sensor.
    fn is_whole(&self, runs: &[Run], chiefs: &Chiefs, reach: i32) -> bool {
        let Views { plan, is_whole, .. } = &self.views;
        let (origin, _) = plan.voxel_lenslets();
        let bits = FRACTION + self.raster.bits[0];
        let ends = runs.iter().flat_map(|run| {
            let line = chiefs.line(run.x as usize, run.y as usize);
            [run.x, run.end - 1].map(|x| (line.at(0, x as usize) >> bits) as i32)
        });
        let (least, most) = ends.fold((i32::MAX, i32::MIN), |(least, most), i| (least.min(i), most.max(i)));
        let row = origin[1] + runs[0].row as i32;
        let mut rows = row - reach..=row + reach;
        rows.all(|j| {
            let first = plan.place(origin[0] + least - reach, j);
            is_whole[first..first + (most - least + 2 * reach + 1) as usize].iter().all(|is_whole| *is_whole)
        })
    }

    /// Keeps voxels of runs that share their group of lenslets.
    fn keep(&self, runs: &[Run], chiefs: &Chiefs, walk: &Walk, all: &mut Sums, kept: &mut Kept) {
        let Run { row, group, .. } = runs[0];
        let (origin, _) = self.views.plan.voxel_lenslets();
        let first = self.views.plan.place(origin[0] + (group as usize * LANES) as i32, origin[1] + row as i32);
        sums(walk, &self.views.shades, first, &mut all.shades);
        let is_whole = self.is_whole(runs, chiefs, walk.reach);
        if !is_whole {
            sums(walk, &self.views.seen, first, &mut all.seen);
        }
        let most = self.scores.len();
        for run in runs {
            self.find_places(run, chiefs, &mut all.places);
            let base = run.y * self.grid.shape[0] as u32 + run.x;
            let voxels = (base..).zip(&all.places);
            if is_whole {
                for (voxel, place) in voxels {
                    let sum = usize::from(all.shades[*place as usize]);
                    if sum < most {
                        kept.push((voxel, self.scores[sum]));
                    }
                }
            } else {
                for (voxel, place) in voxels {
                    let [sum, seen] = [&all.shades, &all.seen].map(|sums| sums[*place as usize]);
                    if i32::from(sum) <= self.most[usize::from(seen)] {
                        kept.push((voxel, self.shades.score(u32::from(sum), u32::from(seen))));
                    }
                }
            }
        }
    }

    /// Finds the place in the sums of each voxel of a run.
    fn find_places(&self, run: &Run, chiefs: &Chiefs, places: &mut Vec<u32>) {
        let line = chiefs.line(run.x as usize, run.y as usize);
        let [x_bits, y_bits] = self.raster.bits;
        let groups = i64::from(run.group) << (FRACTION + x_bits + LANES.ilog2());
        let rows = i64::from(run.row) << (FRACTION + y_bits);
        // Within the group the coordinates fit 32 bits, so it does not matter that they wrap on the way.
        let start = [line.at(0, run.x as usize) - groups, line.at(1, run.x as usize) - rows].map(|start| start as u32);
        let step = [line.step(0), line.step(1)].map(|step| step as u32);
        places.clear();
        places.resize((run.end - run.x) as usize, 0);
        simd::fastest(
            #[inline(always)]
            || {
                for (place, n) in places.iter_mut().zip(0u32..) {
                    let [i, j] = [0, 1].map(|axis| start[axis].wrapping_add(step[axis].wrapping_mul(n)) >> FRACTION);
                    let (lane, i) = (i >> x_bits, i & ((1 << x_bits) - 1));
                    *place = ((j << x_bits) | i) * LANES as u32 + lane;
                }
            },
        );
    }
}

/// End of the run of voxels from `x` that share a group of lenslets; `bits` of the coordinates are within a group.
fn run_end(line: &Line, bits: [u32; 2], x: usize, line_end: usize) -> usize {
    let group = |x: usize| [0, 1].map(|axis| line.at(axis, x) >> bits[axis]);
    let own = group(x);
    let steps = [0, 1].map(|axis| {
        let step = line.step(axis);
        let within = line.at(axis, x) - (own[axis] << bits[axis]);
        let left = if step < 0 { within + 1 } else { (1 << bits[axis]) - within };
        // Steps to the first voxel of another group.
        if step == 0 { i64::MAX } else { (left + step.abs() - 1) / step.abs() }
    });
    let steps = steps[0].min(steps[1]).min((line_end - x) as i64);
    x + steps as usize
}
