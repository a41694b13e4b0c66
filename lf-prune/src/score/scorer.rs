//! Scores the voxels of a slice, one group of lenslets after the other.

use super::cells::Cells;
use super::chiefs::{ChiefLine, Chiefs, FRACTION, LatticeRays};
use super::sections::Sections;
use super::shades::Shades;
use super::sums::add_up;
use super::views::{LANES, LEAST, Views, ViewsPlan};
use super::walk::Raster;
use super::walks::Walks;
use crate::options::Region;
use glam::DVec2;
use lf_core::{Camera, Grid, Optics, simd};

/// Voxels of a slice as (x + nx y, score), rising.
pub(crate) type Kept = Vec<(u32, f32)>;

/// Raster places that a voxel covers along a side of the lattice's cell, or more. With half and with twice as many,
/// `scripts/studies/study prune-cameras` and the full scene keep and lose the same within 0.3 %.
const PLACES_PER_VOXEL: f64 = 2.0;
/// Range of the raster's bits along a side of the lattice's cell. The coordinates of a voxel within a group of lenslets
/// must fit 32 bits. The upper end suffices for voxels down to a 128th of a cell.
const RASTER_BITS: [u32; 2] = [3, u32::BITS - FRACTION - LANES.ilog2()];

/// Copies of the runs in memory: while their list grows, and while they are sorted.
const RUN_COPIES: f64 = 2.5;

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
#[derive(Debug, Clone, Copy)]
struct VoxelRun {
    /// Group of lenslets. Groups count along j first: all rows of the first group, then all rows of the second.
    group: u32,
    y: u32,
    x: u32,
    length: u32,
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

/// Sums of the voxels of one group of lenslets at every place of the raster.
struct GroupSums {
    shades: Vec<u16>,
    /// Number of rays that meet the sensor, where `is_beside` holds; elsewhere all rays do.
    seen: Vec<u16>,
    /// Whether rays may miss the sensor, for each [`LEAST`] lanes.
    is_beside: [bool; LANES / LEAST],
    /// Places in the sums of a run's voxels.
    places: Vec<u32>,
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

/// Bytes that a thread holds for a slice with up to `voxels` voxels in its region, without the voxels kept.
pub(crate) fn thread_bytes(camera: &Camera, grid: &Grid, sections: &Sections, plan: &ViewsPlan, voxels: usize) -> f64 {
    let (optics, cells) = (Optics::new(camera), Cells::new(camera));
    let rays = |z: usize| LatticeRays::new(&optics, &cells, grid, z);
    let middle = rays(grid.shape[2] / 2);
    let (raster, sections_mm) = (raster(&middle), sections.traced_mm());
    let walks = [0, grid.shape[2] / 2, grid.shape[2] - 1]
        .map(|z| Walks::new(&rays(z), camera, &sections_mm, raster, plan).bytes())
        .into_iter()
        .fold(0.0, f64::max);
    // A line of voxels enters a new group after LANES lenslets along i, or one along j.
    let [along_x, _] = middle.per_voxel();
    let runs = (along_x.x.abs() / LANES as f64 + along_x.y.abs()).min(1.0) * voxels as f64;
    let sums = raster.places() * LANES * 2 * size_of::<u16>();
    walks + sums as f64 + RUN_COPIES * runs * size_of::<VoxelRun>() as f64
}

impl<'a> Scorer<'a> {
    pub(crate) fn new(
        shades: &'a Shades<'a>,
        sections: &Sections,
        camera: &'a Camera,
        grid: &'a Grid,
        plan: &ViewsPlan,
    ) -> Self {
        let (optics, cells) = (Optics::new(camera), Cells::new(camera));
        let raster = raster(&LatticeRays::new(&optics, &cells, grid, grid.shape[2] / 2));
        let count = sections.count();
        let most: Vec<i32> = (0..=count).map(|seen| shades.most(seen, count).min(i32::from(u16::MAX))).collect();
        let scores = (0..=most[count as usize]).map(|sum| shades.score(sum as u32, count)).collect();
        let views = Views::new(plan, shades, sections, camera);
        let sections_mm = sections.traced_mm();
        Self { camera, grid, shades, optics, cells, sections_mm, views, raster, most, scores }
    }

    #[cfg(test)]
    pub(super) fn raster(&self) -> Raster {
        self.raster
    }

    #[cfg(test)]
    pub(super) fn grid(&self) -> &Grid {
        self.grid
    }

    pub(super) fn rays(&self, z: usize) -> LatticeRays<'_> {
        LatticeRays::new(&self.optics, &self.cells, self.grid, z)
    }

    /// The voxels kept of a region of slice `z`.
    pub(crate) fn slice(&self, z: usize, region: &Region) -> Kept {
        let rays = self.rays(z);
        let (origin, _) = self.views.plan.voxel_lenslets();
        let chiefs = Chiefs::new(&rays, self.camera, self.raster, origin);
        let mut walks = Walks::new(&rays, self.camera, &self.sections_mm, self.raster, &self.views.plan);
        let size = self.raster.places() * LANES;
        let mut sums = GroupSums {
            shades: vec![0; size],
            seen: vec![0; size],
            is_beside: [false; LANES / LEAST],
            places: Vec::new(),
        };
        let mut kept = Kept::new();
        for runs in self.runs(&chiefs, region).chunk_by(|a, b| a.group == b.group) {
            sums.is_beside = Default::default();
            let lanes = self.lanes(runs);
            for lanes in walks.parts(lanes) {
                self.add_up(runs[0].group, lanes, &mut walks, &mut sums);
            }
            self.keep(runs, &mut sums, &mut kept);
        }
        kept.sort_unstable_by_key(|(place, _)| *place);
        kept
    }

    /// The group's place along a row of lenslets, and its row.
    fn place(&self, group: u32) -> [usize; 2] {
        let (_, [_, rows]) = self.views.plan.voxel_lenslets();
        [group as usize / rows, group as usize % rows]
    }

    /// The voxels of a region whose rays may meet the sensor, by group of lenslets.
    fn runs(&self, chiefs: &Chiefs, region: &Region) -> Vec<VoxelRun> {
        let (_, [groups, rows]) = self.views.plan.voxel_lenslets();
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
    fn lanes(&self, runs: &[VoxelRun]) -> [usize; 2] {
        let bits = FRACTION + self.raster.bits[0];
        let ends = runs.iter().flat_map(|run| [0, run.length - 1].map(|n| (run.at(0, n) >> bits) as usize));
        ends.fold([LANES, 0], |[least, most], lane| [least.min(lane), most.max(lane)])
    }

    /// The first and the last of these lanes whose voxels have rays that may miss the sensor.
    fn beside(&self, group: u32, [least, most]: [usize; 2], reach: i32) -> Option<[usize; 2]> {
        let Views { plan, whole, .. } = &self.views;
        let [group, row] = self.place(group);
        let (reach, first) = (reach as usize, plan.reach as usize);
        let row = group * plan.size[1] + first + row;
        let rows = &whole[row - reach..=row + reach];
        // Find the first and the last whole lane.
        let start = rows.iter().map(|whole| whole.start).max().unwrap_or(0) + reach;
        let end = rows.iter().map(|whole| whole.end).min().unwrap_or(0).saturating_sub(reach);
        let (left, right) = (first + least < start, first + most >= end);
        match (left, right) {
            (false, false) => None,
            (true, false) => Some([least, most.min(start - first - 1)]),
            (false, true) => Some([least.max(end.saturating_sub(first)), most]),
            (true, true) => Some([least, most]),
        }
    }

    /// Adds up the shades of lanes of a group.
    fn add_up(&self, group: u32, [least, most]: [usize; 2], walks: &mut Walks, sums: &mut GroupSums) {
        let ViewsPlan { size: [width, height], reach, .. } = self.views.plan;
        let [along, row] = self.place(group);
        let walk = walks.of(along * LANES + least, row);
        let line = (along * height + row + reach as usize) * self.views.plan.views(self.sections_mm.len());
        let first = line * width + reach as usize;
        add_up(walk, &self.views.shades, first, [least, most], &mut sums.shades);
        if let Some([least, most]) = self.beside(group, [least, most], walk.reach) {
            add_up(walk, &self.views.seen, first, [least, most], &mut sums.seen);
            sums.is_beside[least / LEAST..=most / LEAST].fill(true);
        }
    }

    /// Keeps the bright enough voxels of runs that share their group of lenslets.
    fn keep(&self, runs: &[VoxelRun], all: &mut GroupSums, kept: &mut Kept) {
        let is_beside = all.is_beside.contains(&true);
        let most = self.scores.len();
        for run in runs {
            self.find_places(run, &mut all.places);
            let base = run.y * self.grid.shape[0] as u32 + run.x;
            let voxels = (base..).zip(&all.places);
            if !is_beside {
                for (voxel, place) in voxels {
                    let sum = usize::from(all.shades[*place as usize]);
                    if sum < most {
                        kept.push((voxel, self.scores[sum]));
                    }
                }
                continue;
            }
            for (voxel, place) in voxels {
                let place = *place as usize;
                let sum = all.shades[place];
                let is_beside = all.is_beside[place % LANES / LEAST];
                let seen = if is_beside { usize::from(all.seen[place]) } else { self.sections_mm.len() };
                if i32::from(sum) <= self.most[seen] {
                    kept.push((voxel, self.shades.score(u32::from(sum), seen as u32)));
                }
            }
        }
    }

    /// Finds the place in the sums of each voxel of a run.
    fn find_places(&self, run: &VoxelRun, places: &mut Vec<u32>) {
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
