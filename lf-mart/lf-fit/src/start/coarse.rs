//! The voxels of the sweeps: large ones that hold a voxel of the support, each at its place on the raster.

use lf_core::Grid;
use lf_core::views::{Slices, VoxelRun};
use rayon::prelude::*;

/// The voxels of a slice by groups of lenslets.
pub(super) struct Slice {
    pub(super) groups: Vec<Group>,
    /// Places in a group's sums.
    pub(super) places: Vec<u32>,
    /// x + nx y.
    pub(super) voxels: Vec<u32>,
    pub(super) light: Vec<f32>,
}

/// Neighbouring voxels of the list that share their group of lenslets.
pub(super) struct Group {
    pub(super) group: u32,
    /// First and last lane.
    pub(super) lanes: [usize; 2],
    /// End of its voxels.
    pub(super) end: usize,
}

/// `grid` with voxels that hold `times` of its voxels along each axis.
pub(super) fn coarse_grid(grid: &Grid, times: [usize; 3]) -> Grid {
    Grid {
        shape: std::array::from_fn(|axis| grid.shape[axis].div_ceil(times[axis])),
        spacing_mm: std::array::from_fn(|axis| grid.spacing_mm[axis] * times[axis] as f64),
        origin_mm: std::array::from_fn(|axis| {
            grid.origin_mm[axis] + 0.5 * (times[axis] - 1) as f64 * grid.spacing_mm[axis]
        }),
    }
}

/// The voxels of `slices` that hold a voxel of the support. Voxels whose rays all miss the sensor are left out.
pub(super) fn voxels(slices: &Slices, support: &Grid, indices: &[u64], times: [usize; 3]) -> Vec<Slice> {
    let [nx, ny, _] = support.shape;
    let layer = (nx * ny * times[2]) as u64;
    let width = slices.grid.shape[0];
    (0..slices.grid.shape[2])
        .into_par_iter()
        .map(|z| {
            let [first, end] = [0, 1].map(|step| indices.partition_point(|index| *index < layer * (z + step) as u64));
            let mut holds = vec![false; width * slices.grid.shape[1]];
            for index in &indices[first..end] {
                let [x, y, _] = support.voxel(*index);
                holds[x / times[0] + width * (y / times[1])] = true;
            }
            slice(slices, z, &holds)
        })
        .collect()
}

/// The voxels of slice `z` that are asked for.
fn slice(slices: &Slices, z: usize, holds: &[bool]) -> Slice {
    let [nx, ny, _] = slices.grid.shape;
    let mut slice = Slice { groups: Vec::new(), places: Vec::new(), voxels: Vec::new(), light: Vec::new() };
    let mut places = Vec::new();
    let lane_of = |place: u32| place as usize % lf_core::views::LANES;
    for runs in slices.runs(z, &[0..nx, 0..ny]).chunk_by(|a: &VoxelRun, b| a.group == b.group) {
        let first = slice.voxels.len();
        for run in runs {
            slices.find_places(run, &mut places);
            let base = run.x + run.y * nx as u32;
            for (voxel, place) in (base..).zip(&places) {
                if holds[voxel as usize] {
                    slice.voxels.push(voxel);
                    slice.places.push(*place);
                }
            }
        }
        let lanes = slice.places[first..].iter().map(|place| lane_of(*place));
        if let (Some(least), Some(most)) = (lanes.clone().min(), lanes.max()) {
            let lanes = [least, most];
            slice.groups.push(Group { group: runs[0].group, lanes, end: slice.voxels.len() });
        }
    }
    slice.light = vec![1.0; slice.voxels.len()];
    slice
}
