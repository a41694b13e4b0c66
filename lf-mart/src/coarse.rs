//! Coarse passes: most voxels of a support hold no light, and a sweep over larger voxels tells which.
//!
//! A pass joins the support's voxels into coarse ones, moves the strengths of these by one sweep, and drops the voxels of
//! every coarse one that has lost its light. The next pass, or the sweeps over the voxels themselves, begin with what
//! the pass has found. Far from focus the side of a coarse voxel is a pixel or two as a lenslet shows it, so the coarse
//! voxel around a particle keeps its light. Near focus it is more, and there a pass drops nothing.

use crate::method::Solved;
use crate::operator::keep;
use crate::options::{Options, Until};
use crate::reconstruction::Pass;
use lf_core::{Camera, Grid, Weights};
use rayon::prelude::*;

/// Sides of the coarse voxels of each pass along x, y and z, lenslets at the focal plane. With 14 pixels under a lenslet
/// they are 8 and 4 pixels wide, 20 and 10 deep. A first pass of 16 pixels loses particles (Q .67 for .76 on a hexagonal
/// scene), a last one of 2 pixels costs what it saves.
const SIDES: [[f64; 3]; 2] = [[0.57, 0.57, 1.43], [0.285, 0.285, 0.715]];

/// Most passes.
pub const MOST_PASSES: usize = SIDES.len();

/// The side of a coarse voxel as a lenslet shows it, pixels, above which a depth is near focus. Without such a bound the
/// error of w within 0.4 mm of focus grows by half on a noisy scene, and stays as it was beyond.
const MOST_SHIFT_PX: f64 = 2.2;

/// A voxel begins with no less than this part of the mean.
const LEAST_OF_MEAN: f32 = 0.1;

/// A place in a list that is none.
const NOWHERE: u32 = u32::MAX;

/// A pass that is to be done.
pub(crate) struct Coarse {
    weights: Weights,
    /// Voxels along x, y and z that a coarse voxel joins.
    joined: [usize; 3],
    /// The grid of the support.
    grid: Grid,
    /// Whether a depth is near focus, by z of the support's grid.
    is_near: Vec<bool>,
}

/// The voxels that passes have left of a support.
pub(crate) struct Cleared {
    /// Rising indices of the voxels that may hold light.
    pub(crate) indices: Vec<u64>,
    /// First strength of each, after a pass.
    pub(crate) strengths: Vec<f32>,
    pub(crate) passes: Vec<Pass>,
    /// Voxels of coarse ones that no pixel sees.
    pub(crate) unseen: usize,
}

impl Cleared {
    /// A support before the first pass.
    pub(crate) fn of(indices: Vec<u64>) -> Self {
        Self { indices, strengths: Vec::new(), passes: Vec::new(), unseen: 0 }
    }
}

impl Coarse {
    /// So many passes for voxels of `grid`; fewer where voxels are coarse already.
    pub(crate) fn plan(camera: &Camera, grid: &Grid, options: &Options, passes: usize) -> Vec<Self> {
        let lenslet_mm = camera.microlenses.pitch_mm / camera.main_lens.magnification;
        let of_sides = |sides: &[f64; 3]| {
            let joined = [0, 1, 2].map(|axis| {
                let voxels = (sides[axis] * lenslet_mm / grid.spacing_mm[axis]).round();
                (voxels as usize).clamp(1, grid.shape[axis])
            });
            if joined == [1; 3] {
                return None;
            }
            let shift_px = sides[0] * camera.microlenses.pitch_mm / camera.sensor.pixel_pitch_mm;
            let [from, to] = camera.depths_of_lenslets_mm(shift_px / MOST_SHIFT_PX);
            let is_near = (0..grid.shape[2]).map(|z| (from..to).contains(&grid.centre_mm(2, z))).collect();
            // A camera that sees no depth of the coarse grid's is served without the pass.
            let weights = Weights::choose(camera, &joined_grid(grid, joined), options.weights, options.basis).ok()?;
            Some(Self { weights, joined, grid: grid.clone(), is_near })
        };
        SIDES[..passes.min(MOST_PASSES)].iter().filter_map(of_sides).collect()
    }

    /// The weights of the coarse voxels.
    pub(crate) fn weights(&self) -> &Weights {
        &self.weights
    }

    /// The options of a pass: one sweep, no weights are kept.
    pub(crate) fn options(options: &Options) -> Options {
        Options { iterations: 1, until: Until::Never, max_bytes: 0, ..options.clone() }
    }

    /// The index of the coarse voxel around a voxel.
    fn around(&self, index: u64) -> u64 {
        let voxel = self.grid.voxel(index);
        self.weights.grid().index([0, 1, 2].map(|axis| voxel[axis] / self.joined[axis]))
    }

    /// The rising indices of the coarse voxels around voxels.
    fn voxels(&self, indices: &[u64]) -> Vec<u64> {
        let around = |indices: &[u64]| {
            let mut around: Vec<u64> = indices.iter().map(|index| self.around(*index)).collect();
            around.dedup();
            around
        };
        let mut all: Vec<u64> = indices.par_chunks(1 << 16).flat_map_iter(around).collect();
        all.par_sort_unstable();
        all.dedup();
        all
    }

    /// Where each voxel's coarse voxel stands in a list of them, or [`NOWHERE`].
    fn places(&self, indices: &[u64], coarse: &[u64]) -> Vec<u32> {
        let place = |index: &u64| coarse.binary_search(&self.around(*index)).map_or(NOWHERE, |place| place as u32);
        indices.par_iter().map(place).collect()
    }

    /// The coarse voxels to begin with, and their first strengths if a pass came before.
    pub(crate) fn begin(&self, cleared: &Cleared) -> (Vec<u64>, Option<Vec<f32>>) {
        let voxels = self.voxels(&cleared.indices);
        if cleared.passes.is_empty() {
            return (voxels, None);
        }
        let mut strengths = vec![0.0; voxels.len()];
        let places = self.places(&cleared.indices, &voxels);
        places.iter().zip(&cleared.strengths).for_each(|(place, strength)| strengths[*place as usize] += strength);
        (voxels, Some(strengths))
    }

    /// Drops the voxels whose coarse voxel, of so many, has lost its light, and gives the others their first strengths.
    pub(crate) fn end(&self, cleared: &mut Cleared, voxels: usize, solved: &Solved) {
        let misfit = solved.sweeps.last().map_or(0.0, |sweep| sweep.misfit);
        let weights = solved.sweeps.iter().map(|sweep| sweep.weights).sum();
        cleared.passes.push(Pass { joined: self.joined, voxels, left: solved.indices.len(), misfit, weights });
        let places = self.places(&cleared.indices, &solved.indices);
        let unseen = self.places(&cleared.indices, &solved.unseen);
        cleared.unseen += unseen.iter().filter(|place| **place != NOWHERE).count();
        let is_near = |index: &u64| self.is_near[self.grid.voxel(*index)[2]];
        let near: Vec<bool> = cleared.indices.iter().map(is_near).collect();
        let mut strengths = shared(&places, solved);
        even_out(&mut strengths, &near);
        let both = places.iter().zip(&unseen).zip(&near);
        let held: Vec<bool> =
            both.map(|((place, unseen), near)| *place != NOWHERE || (*near && *unseen == NOWHERE)).collect();
        keep(&mut cleared.indices, &held);
        keep(&mut strengths, &held);
        compress(&mut strengths);
        cleared.strengths = strengths;
    }
}

/// The strength of each coarse voxel, shared by its voxels.
fn shared(places: &[u32], solved: &Solved) -> Vec<f32> {
    let mut voxels = vec![0f32; solved.indices.len()];
    places.iter().filter(|place| **place != NOWHERE).for_each(|place| voxels[*place as usize] += 1.0);
    let of = |place: &u32| match *place {
        NOWHERE => 0.0,
        place => solved.strengths[place as usize] / voxels[place as usize],
    };
    places.iter().map(of).collect()
}

/// Gives each voxel near focus the mean of those.
fn even_out(strengths: &mut [f32], near: &[bool]) {
    let of_near = strengths.iter().zip(near).filter(|(_, near)| **near);
    let (light, count) = of_near.fold((0f64, 0usize), |(light, count), (s, _)| (light + f64::from(*s), count + 1));
    let mean = (light / count.max(1) as f64) as f32;
    strengths.iter_mut().zip(near).filter(|(_, near)| **near).for_each(|(strength, _)| *strength = mean);
}

/// Brings strengths nearer to their mean: to the root of their ratio to it. Strengths of coarse voxels are rough, and a
/// voxel that begins too dim is dropped before the sweeps find its light.
fn compress(strengths: &mut [f32]) {
    let all: f64 = strengths.iter().map(|strength| f64::from(*strength)).sum();
    let mean = (all / strengths.len().max(1) as f64) as f32;
    if mean > 0.0 {
        strengths.iter_mut().for_each(|strength| *strength = mean * (*strength / mean).sqrt().max(LEAST_OF_MEAN));
    }
}

/// The grid of voxels that join so many along x, y and z, from voxel 0 on.
fn joined_grid(grid: &Grid, joined: [usize; 3]) -> Grid {
    let first = |axis: usize| grid.origin_mm[axis] + 0.5 * (joined[axis] - 1) as f64 * grid.spacing_mm[axis];
    Grid {
        shape: [0, 1, 2].map(|axis| grid.shape[axis].div_ceil(joined[axis])),
        spacing_mm: [0, 1, 2].map(|axis| grid.spacing_mm[axis] * joined[axis] as f64),
        origin_mm: [0, 1, 2].map(first),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{cameras, options};
    use crate::{Method, Plan, projector::Projector};
    use ndarray::Array2;

    /// By hand: five voxels of 1 mm from 0 join two and two, and the last stands alone in a whole coarse voxel.
    #[test]
    fn a_joined_grid_begins_at_voxel_0() {
        let grid = Grid { shape: [5, 3, 2], spacing_mm: [1.0, 1.0, 2.0], origin_mm: [0.0, 10.0, -1.0] };
        let joined = joined_grid(&grid, [2, 3, 1]);
        let by_hand = Grid { shape: [3, 1, 2], spacing_mm: [2.0, 3.0, 2.0], origin_mm: [0.5, 11.0, -1.0] };
        assert_eq!(joined, by_hand);
    }

    /// By hand: two voxels of the first coarse one share its light, the voxel of no coarse one has none.
    #[test]
    fn voxels_share_the_light_of_their_coarse_voxel() {
        let solved = Solved { indices: vec![7, 9], strengths: vec![6.0, 4.0], sweeps: Vec::new(), unseen: Vec::new() };
        let mut strengths = shared(&[0, NOWHERE, 0, 1], &solved);
        assert_eq!(strengths, [3.0, 0.0, 3.0, 4.0]);
        even_out(&mut strengths, &[false, true, false, true]);
        assert_eq!(strengths, [3.0, 2.0, 3.0, 2.0]);
        let mut strengths = vec![4.0, 1.0, 0.0, 0.0, 0.0];
        compress(&mut strengths);
        // The mean is 1.
        assert_eq!(strengths, [2.0, 1.0, 0.1, 0.1, 0.1]);
    }

    /// Particles in a full grid: the passes drop most voxels, none near focus and none with light, and the sweeps find
    /// each particle within a voxel.
    #[test]
    fn passes_keep_the_voxels_that_hold_light() {
        let camera = &cameras()[2];
        let grid = Grid::in_bounds([[-0.35, 0.35], [-0.35, 0.35], [-3.3, 3.3]], [0.011, 0.011, 0.11]).unwrap();
        let indices: Vec<u64> = (0..grid.len()).collect();
        let particles = [[11, 20, 5], [40, 41, 9], [50, 13, 20], [30, 30, 52], [17, 45, 56]].map(|at| grid.index(at));
        let weights = Weights::choose(camera, &grid, lf_core::weights::Model::Exact, lf_core::weights::Basis::Point);
        let weights = weights.unwrap();
        let [width, height] = weights.sensor_px();
        let image = Projector::new(&weights, &particles, 1 << 30).project(&[1000.0; 5]);
        assert_eq!(image.dim(), (height, width));
        let solve = |passes: usize, image: &Array2<f32>| {
            let options = Options { passes, ..options(Method::Subsets, 10) };
            Plan::new(camera, &grid, &indices, &options).unwrap().solve(image.view(), None, |_| ()).unwrap()
        };
        let [without, with] = [solve(0, &image), solve(2, &image)];
        assert!(without.passes.is_empty() && with.passes.len() == 2);
        assert!(with.passes.iter().all(|pass| 3 * pass.left < pass.voxels), "{:?}", with.passes);
        let touched = |solved: &crate::Reconstruction| {
            solved.sweeps[0].weights + solved.passes.iter().map(|pass| pass.weights).sum::<u64>()
        };
        assert!(2 * touched(&with) < touched(&without));
        for particle in particles {
            let [x, y, z] = grid.voxel(particle);
            let is_beside = |index: u64| {
                let [i, j, k] = grid.voxel(index);
                i.abs_diff(x) <= 1 && j.abs_diff(y) <= 1 && k.abs_diff(z) <= 1
            };
            let lit = with.indices.iter().zip(&with.intensity).filter(|(index, _)| is_beside(**index));
            let light: f32 = lit.map(|(_, intensity)| *intensity).sum();
            assert!(light > 700.0, "{light} of 1000 at {:?}", [x, y, z]);
        }
    }

    /// Voxels as large as coarse ones need no pass.
    #[test]
    fn coarse_voxels_have_no_pass() {
        let camera = &cameras()[2];
        let grid = Grid::in_bounds([[-0.3, 0.3], [-0.3, 0.3], [-1.5, 1.5]], [0.05, 0.05, 0.15]).unwrap();
        assert!(Coarse::plan(camera, &grid, &options(Method::Subsets, 1), 2).is_empty());
    }
}
