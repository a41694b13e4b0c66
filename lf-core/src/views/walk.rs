//! A walk over all places of the raster in a lenslet's cell, and the sections whose rays change lenslets on the way.
//!
//! Counted from the voxel's own lenslet, the lenslets that its rays meet depend only on its place in that lenslet's
//! cell. From one place to the next few rays change lenslets, so sums are updated by these changes.

use super::cells::{CellShape, Cells, nearest_hexagon, nearest_square, round};
use super::plan::ViewsPlan;
use crate::simd;
use glam::DVec2;

/// Largest number of lenslets along i or j from a ray that starts in the cell (0, 0) to (1, 1) to the nearest centre.
pub(super) const BESIDE: i32 = 2;

/// The raster: 2^bits places along the sides i and j of a lattice's cell. A place stands for the part of the cell
/// around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Raster {
    /// Logarithms of the numbers of places along i and j, to base 2.
    pub bits: [u32; 2],
}

impl Raster {
    /// Number of places.
    pub fn places(self) -> usize {
        1 << (self.bits[0] + self.bits[1])
    }

    /// Places along each side of the cell.
    pub fn scale(self) -> DVec2 {
        DVec2::from(self.bits.map(|bits| f64::from(1 << bits)))
    }

    /// Lattice coordinate of place `n` along an axis.
    #[inline(always)]
    pub(super) fn middle(self, axis: usize, n: usize) -> f64 {
        (n as f64 + 0.5) / f64::from(1 << self.bits[axis])
    }

    /// All places, each next to the one before: `n_i + n_j 2^bits_i`.
    fn path(self) -> impl Iterator<Item = usize> {
        let along = 1usize << self.bits[0];
        (0..self.places()).map(move |n| {
            let (row, column) = (n / along, n % along);
            row * along + if row % 2 == 0 { column } else { along - 1 - column }
        })
    }
}

/// One place of the walk.
#[derive(Debug, Clone, Copy)]
pub(super) struct RasterStep {
    /// The place on the raster, `n_i + n_j 2^bits_i`.
    pub(super) place: u32,
    /// End of its changes.
    pub(super) end: u32,
}

/// A walk over the places of the raster.
pub struct Walk {
    /// Largest number of lenslets along i or j from the voxel's own to another that its rays meet.
    pub reach: i32,
    /// Place of each section's view through its lenslet, counted from the first view through the voxel's own.
    pub(super) start: Vec<i32>,
    pub(super) steps: Vec<RasterStep>,
    /// [new, old] places in the views.
    pub(super) changes: Vec<[i32; 2]>,
}

/// Rays whose views are looked up together.
struct Rays<'a> {
    /// Lattice coordinates along i and j from the chief ray.
    beyond: &'a [Vec<f32>; 2],
    /// Place of each section's first view.
    firsts: &'a [i32],
    shape: CellShape,
    /// Places from row to row of lenslets, and from view to view.
    strides: [i32; 2],
    parts: i32,
}

impl Rays<'_> {
    /// Place of each ray's view, for a voxel at (i, j) of its own lenslet's cell.
    #[inline(always)]
    fn views(&self, i: f32, j: f32, views: &mut [i32]) {
        match self.shape {
            CellShape::Square => self.views_of(nearest_square, i, j, views),
            CellShape::Hexagon => self.views_of(nearest_hexagon, i, j, views),
        }
    }

    #[inline(always)]
    fn views_of(&self, nearest: impl Fn(f32, f32) -> (i32, i32), i: f32, j: f32, views: &mut [i32]) {
        let [rays_i, rays_j] = self.beyond;
        let (rays_i, rays_j, firsts) = (&rays_i[..views.len()], &rays_j[..views.len()], &self.firsts[..views.len()]);
        let [row, view] = self.strides;
        if self.parts == 1 {
            for n in 0..views.len() {
                let (near_i, near_j) = nearest(i + rays_i[n], j + rays_j[n]);
                views[n] = firsts[n] + near_j * row + near_i;
            }
            return;
        }
        // Count parts from a cell's centre, and parts per step of the lattice.
        let most = 0.5 * (self.parts - 1) as f32;
        let per_step = 0.5 * self.parts as f32 / self.shape.half() as f32;
        let part = |beyond: f32| round((per_step * beyond).clamp(-most, most) + most);
        for n in 0..views.len() {
            let (i, j) = (i + rays_i[n], j + rays_j[n]);
            let (near_i, near_j) = nearest(i, j);
            let part = part(j - near_j as f32) * self.parts + part(i - near_i as f32);
            views[n] = firsts[n] + near_j * row + near_i + part * view;
        }
    }
}

impl Walk {
    /// For sections whose rays meet the array at `beyond` of the chief ray, lattice coordinates.
    pub(super) fn new(raster: Raster, beyond: &[DVec2], plan: &ViewsPlan, cells: &Cells) -> Self {
        // Keep a ray within the views even if it reaches beyond all rays that the plan tried.
        let far = f64::from(plan.reach - BESIDE);
        let beyond: [Vec<f32>; 2] =
            [0, 1].map(|axis| beyond.iter().map(|ray| ray[axis].clamp(-far, far) as f32).collect());
        let farthest = beyond.iter().flatten().fold(0f32, |most, ray| most.max(ray.abs()));
        let reach = farthest.ceil() as i32 + BESIDE;
        let (width, parts) = (plan.size[0] as i32, plan.parts as i32);
        let firsts: Vec<i32> = (0..beyond[0].len() as i32).map(|section| section * parts * parts * width).collect();
        let strides = [plan.views(firsts.len()) as i32 * width, width];
        let rays = Rays { beyond: &beyond, firsts: &firsts, shape: cells.shape, strides, parts };
        let mut views = firsts.clone();
        let mut next = firsts.clone();
        let mut walk =
            Self { reach, start: Vec::new(), steps: Vec::with_capacity(raster.places()), changes: Vec::new() };
        let along = 1 << raster.bits[0];
        for place in raster.path() {
            let [i, j] = [raster.middle(0, place % along) as f32, raster.middle(1, place / along) as f32];
            simd::fastest(
                #[inline(always)]
                || rays.views(i, j, &mut next),
            );
            if walk.steps.is_empty() {
                walk.start.clone_from(&next);
            } else {
                let changed = next.iter().zip(&views).filter(|(new, old)| new != old);
                walk.changes.extend(changed.map(|(new, old)| [*new, *old]));
            }
            std::mem::swap(&mut views, &mut next);
            walk.steps.push(RasterStep { place: place as u32, end: walk.changes.len() as u32 });
        }
        walk
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The portable code finds the same views as this machine's widest instructions.
    #[test]
    fn portable_views_are_the_same() {
        let beyond = [0, 1].map(|axis| (0..200).map(|n| 3.7 * ((n * 37 + axis * 11) as f32).sin()).collect());
        let firsts: Vec<i32> = (0..200).map(|section| section * 900).collect();
        for (shape, parts) in
            [(CellShape::Square, 1), (CellShape::Square, 3), (CellShape::Hexagon, 1), (CellShape::Hexagon, 4)]
        {
            let rays = Rays { beyond: &beyond, firsts: &firsts, shape, strides: [180_000, 100], parts };
            for n in 0..50 {
                let (i, j) = (n as f32 / 50.0, (n * 7 % 50) as f32 / 50.0);
                let (mut wide, mut portable) = (firsts.clone(), firsts.clone());
                simd::fastest(
                    #[inline(always)]
                    || rays.views(i, j, &mut wide),
                );
                rays.views(i, j, &mut portable);
                assert_eq!(wide, portable, "{shape:?}, {parts} parts");
            }
        }
    }
}
