//! The voxels of a slice as runs: neighbours on a line whose chief rays meet one group of lenslets.

use super::cells::Cells;
use super::chiefs::{ChiefLine, Chiefs, FRACTION, LatticeRays};
use super::plan::{LANES, ViewsPlan};
use super::walk::Raster;
use super::walks::Walks;
use crate::{Camera, Grid, Optics, simd};
use glam::DVec2;
use std::ops::Range;

/// The voxels of a slice that are traced, along x and y.
pub type Region = [Range<usize>; 2];

/// Raster places that a voxel covers along a side of the lattice's cell, or more. With half and with twice as many,
/// `scripts/studies/study prune-cameras` and the full scene keep and lose the same within 0.3 %.
const PLACES_PER_VOXEL: f64 = 2.0;
/// Range of the raster's bits along a side of the lattice's cell. The coordinates of a voxel within a group of lenslets
/// must fit 32 bits. The upper end suffices for voxels down to a 128th of a cell.
const RASTER_BITS: [u32; 2] = [3, u32::BITS - FRACTION - LANES.ilog2()];

/// Copies of the runs in memory: while their list grows, and while they are sorted.
const RUN_COPIES: f64 = 2.5;

/// Neighbouring voxels of a line whose chief rays meet one group of lenslets.
#[derive(Debug, Clone, Copy)]
pub struct VoxelRun {
    /// Group of lenslets. Groups count along j first: all rows of the first group, then all rows of the second.
    pub group: u32,
    /// Its line.
    pub y: u32,
    /// First voxel.
    pub x: u32,
    /// Number of voxels.
    pub length: u32,
    /// Raster coordinates of the first voxel within the group.
    start: [u32; 2],
    /// Change from voxel to voxel; a negative one wraps.
    step: [u32; 2],
}

impl VoxelRun {
    /// Raster coordinate of voxel `n` within the group. It fits 32 bits, so wrapping on the way does no harm.
    #[inline(always)]
    fn at(&self, axis: usize, n: u32) -> u32 {
        self.start[axis].wrapping_add(self.step[axis].wrapping_mul(n))
    }
}

/// The raster for a slice of voxels: a voxel is scored at a place that is at most a quarter of a voxel from its centre
/// along each side of the lattice.
fn raster(rays: &LatticeRays) -> Raster {
    let [along_x, along_y] = rays.per_voxel();
    let area = along_x.perp_dot(along_y);
    // Find the voxels that a step of one cell passes.
    let voxels = [DVec2::X, DVec2::Y].map(|side| DVec2::new(side.perp_dot(along_y), along_x.perp_dot(side)) / area);
    let bits = |voxels: DVec2| (PLACES_PER_VOXEL * voxels.abs().max_element()).log2().ceil() as i32;
    let [least, most] = RASTER_BITS.map(|bits| bits as i32);
    Raster { bits: voxels.map(|voxels| bits(voxels).clamp(least, most) as u32) }
}

/// Traces the slices of a grid to the raster.
pub struct Slices<'a> {
    camera: &'a Camera,
    /// The grid.
    pub grid: &'a Grid,
    /// The views that its rays meet.
    pub plan: &'a ViewsPlan,
    /// The raster of all slices: that of the middle one.
    pub raster: Raster,
    optics: Optics,
    cells: Cells,
}

impl<'a> Slices<'a> {
    /// The slices of `grid`, for which `plan` was made.
    pub fn new(camera: &'a Camera, grid: &'a Grid, plan: &'a ViewsPlan) -> Self {
        let (optics, cells) = (Optics::new(camera), Cells::new(camera));
        let raster = raster(&LatticeRays::new(&optics, &cells, grid, grid.shape[2] / 2));
        Self { camera, grid, plan, raster, optics, cells }
    }

    /// The rays from slice `z`.
    pub fn rays(&self, z: usize) -> LatticeRays<'_> {
        LatticeRays::new(&self.optics, &self.cells, self.grid, z)
    }

    /// The walks of slice `z` for some sections.
    pub fn walks<'b>(&'b self, rays: &'b LatticeRays<'b>, sections_mm: &'b [DVec2]) -> Walks<'b> {
        Walks::new(rays, self.camera, sections_mm, self.raster, self.plan)
    }

    /// The number of places of a group's sums: all places of the raster, each with [`LANES`] lenslets.
    pub fn sums(&self) -> usize {
        self.raster.places() * LANES
    }

    /// Bytes that a thread holds for the walks and the runs of a slice with up to `voxels` voxels in its region.
    pub fn bytes(&self, sections_mm: &[DVec2], voxels: usize) -> f64 {
        let last = self.grid.shape[2] - 1;
        let walks = [0, self.grid.shape[2] / 2, last].map(|z| self.walks(&self.rays(z), sections_mm).bytes());
        // A line of voxels enters a new group after LANES lenslets along i, or one along j.
        let [along_x, _] = self.rays(self.grid.shape[2] / 2).per_voxel();
        let runs = (along_x.x.abs() / LANES as f64 + along_x.y.abs()).min(1.0) * voxels as f64;
        walks.into_iter().fold(0.0, f64::max) + RUN_COPIES * runs * size_of::<VoxelRun>() as f64
    }

    /// The group's place along a row of lenslets, and its row.
    pub fn place(&self, group: u32) -> [usize; 2] {
        let (_, [_, rows]) = self.plan.voxel_lenslets();
        [group as usize / rows, group as usize % rows]
    }

    /// The voxels of a region of slice `z` whose rays may meet the sensor, by group of lenslets.
    pub fn runs(&self, z: usize, region: &Region) -> Vec<VoxelRun> {
        let (origin, [groups, rows]) = self.plan.voxel_lenslets();
        let chiefs = Chiefs::new(&self.rays(z), self.camera, self.raster, origin);
        let [i_bits, j_bits] = self.raster.bits;
        // Count the bits of a coordinate within a group of lenslets, and within a row.
        let bits = [FRACTION + i_bits + LANES.ilog2(), FRACTION + j_bits];
        let mut runs = Vec::new();
        for y in region[1].clone() {
            let mut x = region[0].start;
            while x < region[0].end {
                let line = chiefs.line(x, y);
                let line_end = chiefs.line_end(x).min(region[0].end);
                while x < line_end {
                    let length = run_length(&line, bits, x).min(line_end - x);
                    let at = [line.at(0, x), line.at(1, x)];
                    let [group, row] = [0, 1].map(|axis| at[axis] >> bits[axis]);
                    if (0..groups as i64).contains(&group) && (0..rows as i64).contains(&row) {
                        let start = [at[0] - (group << bits[0]), at[1] - (row << bits[1])].map(|start| start as u32);
                        let step = [line.step(0), line.step(1)].map(|step| step as u32);
                        let group = (group * rows as i64 + row) as u32;
                        let [y, first, length] = [y, x, length].map(|count| count as u32);
                        runs.push(VoxelRun { group, y, x: first, length, start, step });
                    }
                    x += length;
                }
            }
        }
        by_group(&runs, groups * rows)
    }

    /// The first and the last lane of the voxels of runs.
    pub fn lanes(&self, runs: &[VoxelRun]) -> [usize; 2] {
        let bits = FRACTION + self.raster.bits[0];
        let ends = runs.iter().flat_map(|run| [0, run.length - 1].map(|n| (run.at(0, n) >> bits) as usize));
        ends.fold([LANES, 0], |[least, most], lane| [least.min(lane), most.max(lane)])
    }

    /// Finds the place in the sums of each voxel of a run.
    pub fn find_places(&self, run: &VoxelRun, places: &mut Vec<u32>) {
        let [i_bits, _] = self.raster.bits;
        places.clear();
        places.resize(run.length as usize, 0);
        simd::fastest(
            #[inline(always)]
            || {
                for (place, n) in places.iter_mut().zip(0..) {
                    let [i, j] = [0, 1].map(|axis| run.at(axis, n) >> FRACTION);
                    let (lane, i) = (i >> i_bits, i & ((1 << i_bits) - 1));
                    *place = ((j << i_bits) | i) * LANES as u32 + lane;
                }
            },
        );
    }
}

/// Sorts runs by group; runs of one group keep their order.
fn by_group(runs: &[VoxelRun], groups: usize) -> Vec<VoxelRun> {
    let mut ends = vec![0; groups + 1];
    runs.iter().for_each(|run| ends[run.group as usize + 1] += 1);
    for group in 0..groups {
        ends[group + 1] += ends[group];
    }
    let mut sorted = runs.to_vec();
    for run in runs {
        let end = &mut ends[run.group as usize];
        sorted[*end] = *run;
        *end += 1;
    }
    sorted
}

/// Number of voxels from `x` on in one group of lenslets; the lowest `bits` of a coordinate count within the group.
fn run_length(line: &ChiefLine, bits: [u32; 2], x: usize) -> usize {
    let steps = [0, 1].map(|axis| {
        let (step, at) = (line.step(axis), line.at(axis, x));
        let within = at - (at >> bits[axis] << bits[axis]);
        let left = if step < 0 { within + 1 } else { (1 << bits[axis]) - within };
        // Count the steps to the first voxel of another group.
        if step == 0 { i64::MAX } else { (left - 1) / step.abs() + 1 }
    });
    steps[0].min(steps[1]) as usize
}
