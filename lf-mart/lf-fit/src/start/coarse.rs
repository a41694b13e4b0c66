//! The voxels of the sweeps: large ones that hold a voxel of the support, each at its place on the raster, and a collar
//! of all beside the support from which light reaches the lenslets before it. Without a collar, the light of particles
//! beyond the rim of the frame is taken for particles within it.

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

/// How voxels of the sweeps hold those of a support.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coarse {
    /// Voxels of the support along each axis.
    pub(super) times: [usize; 3],
    /// Voxels of the sweeps on either side of the support, along x and y.
    pub(super) collar: [usize; 2],
}

impl Coarse {
    /// The grid of the sweeps.
    pub(super) fn grid(&self, support: &Grid) -> Grid {
        let Self { times, collar: [x, y] } = *self;
        let collar = [x, y, 0];
        let spacing_mm: [f64; 3] = std::array::from_fn(|axis| support.spacing_mm[axis] * times[axis] as f64);
        Grid {
            shape: std::array::from_fn(|axis| support.shape[axis].div_ceil(times[axis]) + 2 * collar[axis]),
            spacing_mm,
            origin_mm: std::array::from_fn(|axis| {
                let first = support.origin_mm[axis] + 0.5 * (times[axis] - 1) as f64 * support.spacing_mm[axis];
                first - collar[axis] as f64 * spacing_mm[axis]
            }),
        }
    }

    /// The voxels of `slices` that hold a voxel of the support, and those of the collar that lie within `reach_mm` of
    /// the support in their slice. Voxels whose rays all miss the sensor are left out.
    pub(super) fn voxels(
        &self,
        slices: &Slices,
        support: &Grid,
        indices: &[u64],
        reach_mm: impl Fn(usize) -> f64 + Sync,
    ) -> Vec<Slice> {
        let Self { times, collar } = *self;
        let [nx, ny, _] = support.shape;
        let layer = (nx * ny * times[2]) as u64;
        let [width, height, depth] = slices.grid.shape;
        let of_slice = |z: usize| {
            let [first, end] = [0, 1].map(|step| indices.partition_point(|index| *index < layer * (z + step) as u64));
            let reach = [0, 1].map(|axis| (reach_mm(z) / slices.grid.spacing_mm[axis]).ceil() as usize);
            // How far a place along an axis lies in the collar.
            let beside = |axis: usize, n: usize, count: usize| {
                (collar[axis].saturating_sub(n)).max((n + collar[axis] + 1).saturating_sub(count))
            };
            let mut holds = vec![false; width * height];
            for (row, holds) in holds.chunks_mut(width).enumerate() {
                let y = beside(1, row, height);
                for (column, holds) in holds.iter_mut().enumerate() {
                    let x = beside(0, column, width);
                    *holds = (x > 0 || y > 0) && x <= reach[0] && y <= reach[1];
                }
            }
            for index in &indices[first..end] {
                let [x, y, _] = support.voxel(*index);
                holds[x / times[0] + collar[0] + width * (y / times[1] + collar[1])] = true;
            }
            slice(slices, z, &holds)
        };
        (0..depth).into_par_iter().map(of_slice).collect()
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight voxels in twos, and a voxel on either side.
    #[test]
    fn a_grid_with_a_collar_by_hand() {
        let support = Grid { shape: [8, 8, 2], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0, 1.0, -0.5] };
        let grid = Coarse { times: [2, 2, 1], collar: [1, 0] }.grid(&support);
        assert_eq!(grid.shape, [6, 4, 2]);
        assert!((grid.origin_mm[0] + 0.15).abs() < 1e-12 && (grid.origin_mm[1] - 1.05).abs() < 1e-12);
        assert_eq!((grid.spacing_mm, grid.origin_mm[2]), ([0.2, 0.2, 1.0], -0.5));
    }
}
