//! Where the light of a voxel lands on the sensor, seen along one axis.

use crate::{camera::Camera, frame::runs_back, grid::Grid, optics::Optics};
use glam::DVec2;
use std::ops::Range;

/// Reach of a voxel's image beyond the image of its centre, voxels: three standard deviations of a blob.
const BASIS_VOX: f64 = 3.0;

/// From object points to pixels and back, along one axis.
pub(super) struct Reach<'a> {
    grid: &'a Grid,
    optics: Optics,
    camera: &'a Camera,
    axis: usize,
    /// Places along the other axis at which rays are cast, mm: first, middle, last. Distortion varies between them.
    across_mm: [f64; 3],
}

impl<'a> Reach<'a> {
    pub fn new(camera: &'a Camera, grid: &'a Grid, axis: usize) -> Self {
        let last = grid.shape[1 - axis] - 1;
        let across_mm = [0, last / 2, last].map(|place| grid.centre_mm(1 - axis, place));
        Self { grid, optics: Optics::new(camera), camera, axis, across_mm }
    }

    /// Range on the sensor, mm, of light from `along_mm` at depth `z_mm`: of its chief ray for `rim` 0, with rays
    /// through sides and corners of the aperture for 1. A pitch is added on each side, since a ray lands within a pitch
    /// of its lenslet's image centre.
    fn ends(&self, along_mm: f64, z_mm: f64, rim: i32) -> [f64; 2] {
        let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
        for across_mm in self.across_mm {
            let point = if self.axis == 0 { DVec2::new(along_mm, across_mm) } else { DVec2::new(across_mm, along_mm) };
            for (x, y) in (-rim..=rim).flat_map(|x| (-rim..=rim).map(move |y| (x, y))) {
                let aperture_mm = DVec2::new(x.into(), y.into()) * self.optics.half_aperture_mm;
                let hit = self.optics.sensor_from_object(point, z_mm, aperture_mm)[self.axis];
                ends = [ends[0].min(hit), ends[1].max(hit)];
            }
        }
        let pitch = self.camera.microlenses.pitch_mm;
        [ends[0] - pitch, ends[1] + pitch]
    }

    /// Pixels that light from `[from_mm, to_mm]` in the focal plane reaches.
    pub fn pixels(&self, from_mm: f64, to_mm: f64) -> [usize; 2] {
        let sides = [from_mm, to_mm].map(|along| self.ends(along, 0.0, 0));
        let limit = self.optics.sensor_px[self.axis] as f64;
        let place = |mm: f64| self.optics.place_px(DVec2::splat(mm))[self.axis];
        let low = place(sides[0][0].min(sides[1][0])).floor().clamp(0.0, limit);
        let high = place(sides[0][1].max(sides[1][1])).ceil().clamp(0.0, limit);
        [low as usize, high as usize]
    }

    /// Voxels at depth `z_mm` whose light can reach these pixels.
    pub fn voxels(&self, pixels: [usize; 2], z_mm: f64) -> Range<usize> {
        let half = 0.5 * self.optics.sensor_px[self.axis] as f64;
        let edge = |pixel: usize| (pixel as f64 - half) * self.optics.pixel_pitch_mm;
        let limit = self.optics.sensor_px[self.axis];
        // At the sensor's ends, light beside the sensor counts as well.
        let low = if pixels[0] == 0 { f64::NEG_INFINITY } else { edge(pixels[0]) };
        let high = if pixels[1] == limit { f64::INFINITY } else { edge(pixels[1]) };
        let count = self.grid.shape[self.axis];
        let place = |i: f64| self.grid.origin_mm[self.axis] + i * self.grid.spacing_mm[self.axis];
        // Bisect for the first voxel at which a condition fails.
        let first = |holds: &dyn Fn(usize) -> bool| {
            let (mut from, mut to) = (0, count);
            while from < to {
                let middle = from + (to - from) / 2;
                if holds(middle) { from = middle + 1 } else { to = middle }
            }
            from
        };
        // Along the axis the light moves to higher pixels or to lower ones. Voxels before the range miss the pixels on
        // one side, voxels behind it on the other.
        let ends = |i: usize, reach_vox: f64| self.ends(place(i as f64 + reach_vox), z_mm, 1);
        let (before, after): (&dyn Fn(usize) -> bool, &dyn Fn(usize) -> bool) = if runs_back(self.axis) {
            (&|i| ends(i, BASIS_VOX)[0] > high, &|i| ends(i, -BASIS_VOX)[1] < low)
        } else {
            (&|i| ends(i, BASIS_VOX)[1] < low, &|i| ends(i, -BASIS_VOX)[0] > high)
        };
        first(before)..first(&|i| !after(i))
    }
}
