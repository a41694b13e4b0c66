//! A distorted image and lenslets that depart from their lattice: tiles so small that all rays of one are moved alike.

use super::shifted;
use crate::views::Views;
use crate::{Levels, Slice};
use glam::DVec2;
use lf_core::camera::Camera;
use lf_core::grid::Grid;
use lf_core::optics::Optics;

/// Most that a voxel's rays are moved otherwise than its tile's, px: a hundredth of a lenslet, so few rays pass another one.
const ALIKE_PX: f64 = 0.15;
/// Sides that a tile may have, voxels.
const SIDES: [usize; 6] = [512, 256, 128, 64, 32, 16];
/// Places a side at which the change of the shift is looked at.
const PLACES: usize = 9;

/// Where the rays of one slice are moved to.
struct Shift<'a> {
    optics: Optics,
    grid: &'a Grid,
    z_mm: f64,
}

impl Shift<'_> {
    /// Of the voxel at a place, in voxels, mm on the perfect lattice.
    fn at_mm(&self, place: DVec2) -> DVec2 {
        let place_mm = DVec2::new(
            self.grid.origin_mm[0] + place.x * self.grid.spacing_mm[0],
            self.grid.origin_mm[1] + place.y * self.grid.spacing_mm[1],
        );
        let straight = -self.optics.beta(self.z_mm) * place_mm;
        let moved = straight + self.optics.distortion_mm(place_mm, self.z_mm);
        self.optics.lattice().perfect(moved) - straight
    }

    /// The longest side over which, half a tile from its middle, rays are moved alike.
    fn side(&self, pixel_mm: f64) -> usize {
        let size = DVec2::new(self.grid.shape[0] as f64, self.grid.shape[1] as f64);
        let is_alike = |side: usize| {
            (0..PLACES * PLACES).all(|n| {
                let part = DVec2::new((n % PLACES) as f64, (n / PLACES) as f64) / (PLACES - 1) as f64;
                let (middle, half) = (part * size, 0.5 * side as f64);
                [DVec2::new(half, half), DVec2::new(half, -half)]
                    .iter()
                    .all(|way| self.at_mm(middle + *way).distance(self.at_mm(middle)) < ALIKE_PX * pixel_mm)
            })
        };
        SIDES.into_iter().find(|side| is_alike(*side)).unwrap_or(SIDES[SIDES.len() - 1])
    }
}

/// As [`super::slice`], tile by tile.
pub(super) fn slice(levels: &Levels, camera: &Camera, views: &Views, grid: &Grid, z: usize) -> Slice {
    let shift = Shift { optics: Optics::new(camera), grid, z_mm: grid.centre_mm(2, z) };
    let side = shift.side(camera.sensor.pixel_pitch_mm);
    let [nx, ny, nz] = grid.shape;
    let mut kept = Slice::new();
    for first_y in (0..ny).step_by(side) {
        for first_x in (0..nx).step_by(side) {
            let (width, height) = (side.min(nx - first_x), side.min(ny - first_y));
            let middle =
                DVec2::new(first_x as f64, first_y as f64) + 0.5 * DVec2::new(width as f64, height as f64) - 0.5;
            let tile = Grid {
                shape: [width, height, nz],
                origin_mm: [grid.centre_mm(0, first_x), grid.centre_mm(1, first_y), grid.origin_mm[2]],
                ..grid.clone()
            };
            let found = shifted(levels, camera, views, &tile, z, shift.at_mm(middle));
            kept.extend(found.into_iter().map(|(place, score)| {
                let (x, y) = (place as usize % width, place as usize / width);
                (((first_y + y) * nx + first_x + x) as u32, score)
            }));
        }
    }
    kept.sort_unstable_by_key(|(place, _)| *place);
    kept
}
