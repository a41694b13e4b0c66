//! Scores for distortion and for lenslets that depart from their lattice: in tiles so small that all rays shift alike.

use super::{line_sums, views::Views};
use crate::score::rays;
use crate::score::slice::{Kept, Slice};
use glam::DVec2;
use lf_core::{Camera, Grid, Optics};

/// Largest chief-ray error within a tile, px: a hundredth of a lenslet, so few rays pass another lenslet.
const CHIEF_PX: f64 = 0.15;
/// Largest error of rays through the stop's rim, px: one in twenty passes another lenslet. Beyond it rays are traced.
const RIM_PX: f64 = 0.7;
/// Sides that a tile may have, voxels.
const SIDES: [usize; 6] = [512, 256, 128, 64, 32, 16];
/// Places a side of a slice at which the change of the shift is measured.
const PLACES: usize = 9;

struct Shift<'a> {
    optics: Optics,
    grid: &'a Grid,
    z_mm: f64,
}

impl Shift<'_> {
    /// The shift on the perfect lattice, mm, of a ray that meets the array `spread_mm` from the chief ray of the voxel
    /// at `place`.
    fn at_mm(&self, place: DVec2, spread_mm: DVec2) -> DVec2 {
        let [[x, y, _], [dx, dy, _]] = [self.grid.origin_mm, self.grid.spacing_mm];
        let place_mm = DVec2::new(x + place.x * dx, y + place.y * dy);
        let straight = spread_mm + self.optics.straight_rays(self.z_mm).chief_mm(place_mm);
        let moved = straight + self.optics.distortion_mm(place_mm, self.z_mm);
        self.optics.lattice().perfect(moved) - straight
    }

    /// The longest side of a tile over which rays shift alike, at its corners and through the stop's rim, if any.
    fn side(&self, pixel_mm: f64) -> Option<usize> {
        let size = DVec2::new(self.grid.shape[0] as f64, self.grid.shape[1] as f64);
        let spread = self.optics.alpha(self.z_mm) * self.optics.half_aperture_mm;
        let middles = (0..PLACES * PLACES)
            .map(|n| DVec2::new((n % PLACES) as f64, (n / PLACES) as f64) / (PLACES - 1) as f64 * size);
        let most = CHIEF_PX * pixel_mm;
        let is_alike = |side: usize| {
            let half = 0.5 * side as f64;
            middles.clone().all(|middle| {
                let chief = self.at_mm(middle, DVec2::ZERO);
                let corners = [DVec2::new(half, half), DVec2::new(half, -half)];
                corners.iter().all(|way| self.at_mm(middle + *way, DVec2::ZERO).distance(chief) < most)
            })
        };
        let through_rim = [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y].map(|way| spread * way);
        let is_stiff = middles.clone().all(|middle| {
            let chief = self.at_mm(middle, DVec2::ZERO);
            through_rim.iter().all(|rim| self.at_mm(middle, *rim).distance(chief) < RIM_PX * pixel_mm)
        });
        SIDES.into_iter().find(|side| is_stiff && is_alike(*side))
    }
}

pub(crate) fn slice(slice: &Slice, camera: &Camera, views: &Views) -> Kept {
    let Slice { grid, z, region, .. } = *slice;
    let shift = Shift { optics: Optics::new(camera), grid, z_mm: grid.centre_mm(2, z) };
    let Some(side) = shift.side(camera.sensor.pixel_pitch_mm) else {
        return rays::slice(slice, camera);
    };
    let [nx, ny, nz] = grid.shape;
    let mut kept = Kept::new();
    // Tiles begin at the same voxels for any region of the slice.
    for first_y in (region[1].start / side * side..region[1].end).step_by(side) {
        for first_x in (region[0].start / side * side..region[0].end).step_by(side) {
            let (width, height) = (side.min(nx - first_x), side.min(ny - first_y));
            let first = DVec2::new(first_x as f64, first_y as f64);
            let middle = first + 0.5 * DVec2::new(width as f64, height as f64) - 0.5;
            let tile = Grid {
                shape: [width, height, nz],
                origin_mm: [grid.centre_mm(0, first_x), grid.centre_mm(1, first_y), grid.origin_mm[2]],
                ..grid.clone()
            };
            let tile = Slice { grid: &tile, region: &[0..width, 0..height], ..*slice };
            let found = line_sums::slice(&tile, views, shift.at_mm(middle, DVec2::ZERO));
            let places = found.into_iter().map(|(place, score)| {
                let (x, y) = (place as usize % width, place as usize / width);
                (first_x + x, first_y + y, score)
            });
            let wanted = places.filter(|(x, y, _)| region[0].contains(x) && region[1].contains(y));
            kept.extend(wanted.map(|(x, y, score)| ((y * nx + x) as u32, score)));
        }
    }
    kept.sort_unstable_by_key(|(place, _)| *place);
    kept
}
