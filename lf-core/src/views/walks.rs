//! The walks of a slice: one, or one for each block of lenslets if the rays of a bundle part differently from place to
//! place.

use super::chiefs::LatticeRays;
use super::plan::{LANES, LEAST, ViewsPlan};
use super::walk::{Raster, RasterStep, Walk};
use crate::Camera;
use glam::DVec2;
use std::ops::Range;

/// Largest error of a ray through the stop's rim against its chief ray, px on the array, if the rays in the middle of
/// its block are used. It is less than half of the step of a voxel of 2 px to its place of the raster. With 0.4 a water
/// tank takes a third less time.
const APART_PX: f64 = 0.2;
/// Numbers of blocks along an axis to try.
const BLOCKS: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];
/// Blocks along an axis at which a number of blocks is tested.
const TRIED: usize = 5;

/// The walks of a slice, each made when it is first asked for.
pub struct Walks<'a> {
    rays: &'a LatticeRays<'a>,
    sections_mm: &'a [DVec2],
    raster: Raster,
    plan: &'a ViewsPlan,
    /// Lanes and rows of a block.
    side: [usize; 2],
    /// The blocks along a row whose walks are known, and their walks, row after row.
    blocks: Range<usize>,
    walks: Vec<Option<Walk>>,
}

impl<'a> Walks<'a> {
    /// The walks for these sections.
    pub fn new(
        rays: &'a LatticeRays,
        camera: &Camera,
        sections_mm: &'a [DVec2],
        raster: Raster,
        plan: &'a ViewsPlan,
    ) -> Self {
        let (_, size) = plan.voxel_lenslets();
        let blocks = blocks(rays, camera);
        let lanes = size[0] * LANES / blocks;
        let lanes = if lanes < LANES { (lanes + 1).next_power_of_two() / 2 } else { lanes / LANES * LANES };
        let side = [lanes.max(LEAST), size[1].div_ceil(blocks)];
        Self { rays, sections_mm, raster, plan, side, blocks: 0..0, walks: Vec::new() }
    }

    /// Cuts the lanes from `least` to `most` of a group into parts that share a walk.
    pub fn parts(&self, [least, most]: [usize; 2]) -> impl Iterator<Item = [usize; 2]> + use<> {
        let side = self.side[0].min(LANES);
        (least / side..=most / side).map(move |part| [least.max(part * side), most.min((part + 1) * side - 1)])
    }

    /// Number of blocks along a row whose walks are held: those of a group.
    fn held(&self) -> usize {
        (LANES / self.side[0]).max(1)
    }

    /// Bytes of all walks that are held at once.
    pub fn bytes(&self) -> f64 {
        let (_, size) = self.plan.voxel_lenslets();
        let walks = self.held() * size[1].div_ceil(self.side[1]);
        // Count the changes: on a line of places each ray leaves every part of a cell once, 1.5 times in a hexagon.
        let lines = f64::from(1 << self.raster.bits[1]) + 1.0;
        let changes = 1.5 * lines * (self.sections_mm.len() * self.plan.parts) as f64;
        walks as f64
            * (changes * size_of::<[i32; 2]>() as f64 + (self.raster.places() * size_of::<RasterStep>()) as f64)
    }

    /// The walk for a lane, counted along all groups, in a row of lenslets. It is fastest if groups never decrease.
    pub fn of(&mut self, lane: usize, row: usize) -> &Walk {
        let (block, block_row) = (lane / self.side[0], row / self.side[1]);
        let (_, size) = self.plan.voxel_lenslets();
        if self.walks.is_empty() || !self.blocks.contains(&block) {
            // Keep all blocks of a group, since each row uses them all.
            let many = self.held();
            let first = block / many * many;
            self.blocks = first..first + many;
            self.walks.clear();
            self.walks.resize_with(self.blocks.len() * size[1].div_ceil(self.side[1]), || None);
        }
        let place = (block - self.blocks.start) + self.blocks.len() * block_row;
        if self.walks[place].is_none() {
            let voxel = self.middle(block, block_row);
            let beyond = beyond(self.rays, voxel, self.sections_mm);
            self.walks[place] = Some(Walk::new(self.raster, &beyond, self.plan, self.rays.cells));
        }
        self.walks[place].as_ref().expect("made above")
    }

    /// The place in voxels, within the grid, that stands for a block.
    fn middle(&self, block: usize, row: usize) -> DVec2 {
        let (origin, size) = self.plan.voxel_lenslets();
        if self.side[0] >= size[0] * LANES && self.side[1] >= size[1] {
            return self.rays.middle();
        }
        let along = |first: i32, block: usize, side: usize| f64::from(first) + (block as f64 + 0.5) * side as f64;
        let i = along(origin[0], block, self.side[0]);
        let j = along(origin[1], row, self.side[1]);
        self.rays.voxel(DVec2::new(i, j)).clamp(DVec2::ZERO, 2.0 * self.rays.middle())
    }
}

/// Lattice coordinates of rays through places of the stop, from the chief ray's.
fn beyond(rays: &LatticeRays, voxel: DVec2, stop_mm: &[DVec2]) -> Vec<DVec2> {
    let chief = rays.chief(voxel);
    stop_mm.iter().map(|stop_mm| rays.place(voxel, *stop_mm) - chief).collect()
}

/// Number of blocks along an axis. Within a block the rays of every bundle spread in the same way.
fn blocks(rays: &LatticeRays, camera: &Camera) -> usize {
    if camera.medium.is_none() && camera.centres.is_none() && camera.aberrations.is_none() {
        return 1;
    }
    let most = APART_PX / camera.pitch_px();
    let rim = [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y].map(|way| way * rays.optics.half_aperture_mm);
    let is_alike = |blocks: usize| {
        let block = 2.0 * rays.middle() / blocks as f64;
        let tried = TRIED.min(blocks);
        (0..tried * tried).all(|n| {
            let nth = |n: usize| if tried == 1 { 0.0 } else { (n * (blocks - 1)) as f64 / (tried - 1) as f64 };
            let corner = block * DVec2::new(nth(n % tried), nth(n / tried));
            let middle = beyond(rays, corner + 0.5 * block, &rim);
            [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE].into_iter().all(|way| {
                let there = beyond(rays, corner + way * block, &rim);
                there.iter().zip(&middle).all(|(a, b)| (*a - *b).abs().max_element() < most)
            })
        })
    };
    BLOCKS.into_iter().find(|blocks| is_alike(*blocks)).unwrap_or(BLOCKS[BLOCKS.len() - 1])
}
