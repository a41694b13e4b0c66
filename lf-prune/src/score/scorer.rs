//! Scores the voxels of a slice, one group of lenslets after the other.

use super::shades::Shades;
use super::views::Views;
use glam::DVec2;
use lf_core::views::{LANES, LEAST, Region, Sections, Slices, ViewsPlan, VoxelRun, Walks, add_up};
use lf_core::{Camera, Grid};

/// Voxels of a slice as (x + nx y, score), rising.
pub(crate) type Kept = Vec<(u32, f32)>;

/// Scores slices of voxels against an image.
pub(crate) struct Scorer<'a> {
    pub(super) slices: Slices<'a>,
    shades: &'a Shades<'a>,
    sections_mm: Vec<DVec2>,
    views: Views<'a>,
    /// Largest sum of shades of a voxel that is kept, for each number of rays that meet the sensor.
    most: Vec<i32>,
    /// Score of each sum up to the largest, if all rays meet the sensor.
    scores: Vec<f32>,
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

/// Bytes of the views.
pub(crate) fn views_bytes(plan: &ViewsPlan, sections: &Sections) -> f64 {
    plan.bytes(sections.count(), Views::BYTES)
}

/// Bytes that a thread holds for a slice with up to `voxels` voxels in its region, without the voxels kept.
pub(crate) fn thread_bytes(camera: &Camera, grid: &Grid, sections: &Sections, plan: &ViewsPlan, voxels: usize) -> f64 {
    let slices = Slices::new(camera, grid, plan);
    let sums = slices.sums() * 2 * size_of::<u16>();
    slices.bytes(&sections.traced_mm(), voxels) + sums as f64
}

impl<'a> Scorer<'a> {
    pub(crate) fn new(
        shades: &'a Shades<'a>,
        sections: &Sections,
        camera: &'a Camera,
        grid: &'a Grid,
        plan: &'a ViewsPlan,
    ) -> Self {
        let slices = Slices::new(camera, grid, plan);
        let count = sections.count();
        let most: Vec<i32> = (0..=count).map(|seen| shades.most(seen, count).min(i32::from(u16::MAX))).collect();
        let scores = (0..=most[count as usize]).map(|sum| shades.score(sum as u32, count)).collect();
        let sections_mm = sections.traced_mm();
        let views = Views::new(plan, shades, &sections_mm, camera);
        Self { slices, shades, sections_mm, views, most, scores }
    }

    /// The voxels kept of a region of slice `z`.
    pub(crate) fn slice(&self, z: usize, region: &Region) -> Kept {
        let rays = self.slices.rays(z);
        let mut walks = self.slices.walks(&rays, &self.sections_mm);
        let size = self.slices.sums();
        let mut sums = GroupSums {
            shades: vec![0; size],
            seen: vec![0; size],
            is_beside: [false; LANES / LEAST],
            places: Vec::new(),
        };
        let mut kept = Kept::new();
        for runs in self.slices.runs(z, region).chunk_by(|a, b| a.group == b.group) {
            sums.is_beside = Default::default();
            let lanes = self.slices.lanes(runs);
            for lanes in walks.parts(lanes) {
                self.add_up(runs[0].group, lanes, &mut walks, &mut sums);
            }
            self.keep(runs, &mut sums, &mut kept);
        }
        kept.sort_unstable_by_key(|(place, _)| *place);
        kept
    }

    /// The first and the last of these lanes whose voxels have rays that may miss the sensor.
    fn beside(&self, group: u32, [least, most]: [usize; 2], reach: i32) -> Option<[usize; 2]> {
        let Views { plan, whole, .. } = &self.views;
        let [group, row] = self.slices.place(group);
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
        let plan = self.views.plan;
        let ViewsPlan { size: [width, height], reach, .. } = *plan;
        let [along, row] = self.slices.place(group);
        let walk = walks.of(along * LANES + least, row);
        let line = (along * height + row + reach as usize) * plan.views(self.sections_mm.len());
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
            self.slices.find_places(run, &mut all.places);
            let base = run.y * self.slices.grid.shape[0] as u32 + run.x;
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
}
