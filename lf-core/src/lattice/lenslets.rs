//! From points of the array to lenslets and back.

use super::keys::{Centres, Layout, Microlenses};
use glam::{DMat2, DVec2};
use std::ops::RangeInclusive;

/// Fixed-point steps back to the perfect lattice; each reduces the error to some thousandths, a fifth at worst.
const BACK_STEPS: usize = 3;

/// Centres and cells of the lenslets. A cell is the part of the array whose light a lenslet takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    layout: Layout,
    pitch_mm: f64,
    offset_mm: DVec2,
    rotation: DMat2,
    centres: Option<Centres>,
    /// Upper bound of the departure's gradient.
    steepest: f64,
}

impl Lattice {
    /// The lattice of a camera's microlenses; see [`crate::camera::Camera::lattice`].
    pub(crate) fn new(microlenses: &Microlenses, centres: Option<&Centres>) -> Self {
        Self {
            layout: microlenses.layout,
            pitch_mm: microlenses.pitch_mm,
            offset_mm: DVec2::from(microlenses.offset_mm),
            rotation: DMat2::from_angle(microlenses.rotation_rad),
            centres: centres.cloned(),
            steepest: centres.map_or(0.0, Centres::steepest),
        }
    }

    /// Whether the lenslets depart from the perfect lattice.
    pub fn departs(&self) -> bool {
        self.centres.is_some()
    }

    /// Centre of the lenslet whose perfect centre is `perfect_mm`, mm.
    #[inline]
    pub fn departed(&self, perfect_mm: DVec2) -> DVec2 {
        match &self.centres {
            None => perfect_mm,
            Some(centres) => perfect_mm + centres.departure_mm(perfect_mm),
        }
    }

    /// Inverse of [`Lattice::departed`] for any point of the array: its place if no lenslet departed, mm.
    #[inline]
    pub fn perfect(&self, point_mm: DVec2) -> DVec2 {
        let Some(centres) = &self.centres else { return point_mm };
        (0..BACK_STEPS).fold(point_mm, |perfect, _| point_mm - centres.departure_mm(perfect))
    }

    /// Distance between rows of lenslets, mm.
    pub fn row_pitch_mm(&self) -> f64 {
        if self.layout == Layout::Square { self.pitch_mm } else { self.pitch_mm * 0.75f64.sqrt() }
    }

    /// Distance along y between lenslets that lie in line along x, or nearly so, mm. Rows of lenslets run along x up to
    /// a rotation of 45 degrees; beyond, they run along y, and the pitch is this distance.
    pub fn period_y_mm(&self) -> f64 {
        let is_upright = self.rotation.x_axis.y.abs() > self.rotation.x_axis.x.abs();
        if is_upright { self.pitch_mm } else { self.row_pitch_mm() }
    }

    /// Shift of row `j` along the row, pitches.
    #[inline]
    fn row_shift(&self, j: i64) -> f64 {
        if self.layout == Layout::Square { 0.5 } else { 0.5 * (j & 1) as f64 }
    }

    /// Distance of row 0 from the offset, row pitches.
    #[inline]
    fn first_row(&self) -> f64 {
        if self.layout == Layout::Square { 0.5 } else { 0.0 }
    }

    /// Centre of lenslet (i, j), mm.
    #[inline]
    pub fn centre_mm(&self, i: i64, j: i64) -> DVec2 {
        let along = (i as f64 + self.row_shift(j)) * self.pitch_mm;
        let across = (j as f64 + self.first_row()) * self.row_pitch_mm();
        self.departed(self.offset_mm + self.rotation * DVec2::new(along, across))
    }

    /// The lenslet (i, j) whose cell holds a point of the array. Cells belong to the nearest centre; with departures,
    /// to the nearest perfect centre after [`Lattice::perfect`].
    #[inline]
    pub fn lenslet_at(&self, point_mm: DVec2) -> (i64, i64) {
        let q = self.rotation.transpose() * (self.perfect(point_mm) - self.offset_mm);
        match self.layout {
            Layout::Square => ((q.x / self.pitch_mm).floor() as i64, (q.y / self.pitch_mm).floor() as i64),
            Layout::Hexagonal => {
                let row_pitch = self.row_pitch_mm();
                let below = (q.y / row_pitch).floor() as i64;
                let nearest = |j: i64| {
                    let i = (q.x / self.pitch_mm - self.row_shift(j)).round();
                    let dx = q.x - (i + self.row_shift(j)) * self.pitch_mm;
                    let dy = q.y - j as f64 * row_pitch;
                    (dx * dx + dy * dy, i as i64)
                };
                let (low, high) = (nearest(below), nearest(below + 1));
                if low.0 <= high.0 { (low.1, below) } else { (high.1, below + 1) }
            }
        }
    }

    /// Centre of the lenslet of [`Lattice::lenslet_at`], mm, without branches.
    #[inline(always)]
    pub fn nearest_centre_mm(&self, point_mm: DVec2) -> DVec2 {
        if let Some(centres) = &self.centres {
            let perfect = self.nearest_perfect_mm(self.perfect(point_mm));
            return perfect + centres.departure_mm(perfect);
        }
        self.nearest_perfect_mm(point_mm)
    }

    #[inline(always)]
    fn nearest_perfect_mm(&self, point_mm: DVec2) -> DVec2 {
        // Written by components, so that the compiler handles several points at once.
        let (cos, sin) = (self.rotation.x_axis.x, self.rotation.x_axis.y);
        let (x, y) = (point_mm.x - self.offset_mm.x, point_mm.y - self.offset_mm.y);
        let (qx, qy) = (cos * x + sin * y, cos * y - sin * x);
        let per_pitch = 1.0 / self.pitch_mm;
        let (cx, cy) = match self.layout {
            Layout::Square => {
                (((qx * per_pitch).floor() + 0.5) * self.pitch_mm, ((qy * per_pitch).floor() + 0.5) * self.pitch_mm)
            }
            Layout::Hexagonal => {
                // Compare the nearest centre of the row below with that of the row above, which has the other shift.
                let row_pitch = self.row_pitch_mm();
                let below = (qy * (1.0 / row_pitch)).floor();
                let (x, shift) = (qx * per_pitch, 0.5 * below - (0.5 * below).floor());
                let (low_x, high_x) = ((x - shift + 0.5).floor() + shift, (x + shift).floor() + 0.5 - shift);
                let (low_x, high_x) = (low_x * self.pitch_mm, high_x * self.pitch_mm);
                let (low_y, high_y) = (below * row_pitch, (below + 1.0) * row_pitch);
                let low = (qx - low_x) * (qx - low_x) + (qy - low_y) * (qy - low_y);
                let high = (qx - high_x) * (qx - high_x) + (qy - high_y) * (qy - high_y);
                (if low <= high { low_x } else { high_x }, if low <= high { low_y } else { high_y })
            }
        };
        DVec2::new(self.offset_mm.x + cos * cx - sin * cy, self.offset_mm.y + cos * cy + sin * cx)
    }

    /// Coordinates of a point of the perfect lattice, in pitches and row pitches, with the shift of the rows.
    fn place(&self, point_mm: DVec2) -> DVec2 {
        let q = self.rotation.transpose() * (point_mm - self.offset_mm);
        DVec2::new(q.x / self.pitch_mm, q.y / self.row_pitch_mm())
    }

    /// The lenslets (i, j, centre in mm) of [`Lattice::rows_within`] about any point of the array, row by row.
    pub fn lenslets_within(&self, point_mm: DVec2, reach_mm: DVec2) -> impl Iterator<Item = (i64, i64, DVec2)> + '_ {
        let rows = self.rows_within(self.perfect(point_mm), reach_mm);
        rows.flat_map(move |(j, lenslets)| lenslets.map(move |i| (i, j, self.centre_mm(i, j))))
    }

    /// Rows j and ranges of i whose centres lie within `reach_mm` of a point of the perfect lattice, and a few more.
    #[inline]
    pub fn rows_within(
        &self,
        perfect_mm: DVec2,
        reach_mm: DVec2,
    ) -> impl Iterator<Item = (i64, RangeInclusive<i64>)> + use<> {
        let q = self.place(perfect_mm);
        // Departures vary within the box and can move a lenslet into it.
        let reach_mm = reach_mm + DVec2::splat(self.steepest * reach_mm.max_element());
        // Enclose the box in one that is turned with the lattice.
        let (sin, cos) = (self.rotation.x_axis.y.abs(), self.rotation.x_axis.x.abs());
        let along = (reach_mm.x * cos + reach_mm.y * sin) / self.pitch_mm;
        let across = (reach_mm.x * sin + reach_mm.y * cos) / self.row_pitch_mm();
        let first_row = (q.y - across - self.first_row()).ceil() as i64;
        let last_row = (q.y + across - self.first_row()).floor() as i64;
        let shifts = [self.row_shift(0), self.row_shift(1)];
        (first_row..=last_row).map(move |j| {
            let shift = shifts[(j & 1) as usize];
            (j, (q.x - along - shift).ceil() as i64..=(q.x + along - shift).floor() as i64)
        })
    }

    /// The perfect lattice in rows nearly along x: the centre of one lenslet, the step to the next in its row, which
    /// has a positive x, and the step to another row, mm.
    pub(crate) fn rows_along_x(&self) -> [DVec2; 3] {
        let shift = if self.layout == Layout::Square { 0.0 } else { 0.5 };
        let mut along = self.rotation * DVec2::new(self.pitch_mm, 0.0);
        let mut across = self.rotation * DVec2::new(shift * self.pitch_mm, self.row_pitch_mm());
        // A square lattice is symmetric under a quarter of a turn, a hexagonal one under a sixth.
        let (corners, next): (f64, fn(DVec2, DVec2) -> DVec2) = if self.layout == Layout::Square {
            (4.0, |along, _| -along)
        } else {
            (6.0, |along, across| across - along)
        };
        while along.y.abs() > along.x.abs() * (1.001 * std::f64::consts::PI / corners).tan() {
            (along, across) = (across, next(along, across));
        }
        if along.x < 0.0 {
            (along, across) = (-along, -across);
        }
        let half = if self.layout == Layout::Square { DVec2::splat(0.5 * self.pitch_mm) } else { DVec2::ZERO };
        [self.offset_mm + self.rotation * half, along, across]
    }

    /// Turns of a point of the array along two directions of the lattice: whole numbers at the centres of lenslets.
    pub(crate) fn turns(&self, point_mm: DVec2) -> DVec2 {
        let place = self.place(self.perfect(point_mm));
        match self.layout {
            Layout::Square => place - DVec2::splat(0.5),
            Layout::Hexagonal => DVec2::new(place.x - 0.5 * place.y, place.y),
        }
    }

    /// The shift, mm, that changes [`Lattice::turns`] by `turns` where no lenslet departs.
    pub(crate) fn shift_mm(&self, turns: DVec2) -> DVec2 {
        let along = if self.layout == Layout::Square { turns.x } else { turns.x + 0.5 * turns.y };
        self.rotation * DVec2::new(along * self.pitch_mm, turns.y * self.row_pitch_mm())
    }

    /// Corners of a perfect cell relative to its centre, in order around it, mm.
    pub fn cell_mm(&self) -> Vec<DVec2> {
        let side = 1.0 / 3f64.sqrt();
        let half = side / 2.0;
        let corners = match self.layout {
            Layout::Square => &[(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)][..],
            Layout::Hexagonal => &[(0.0, -side), (0.5, -half), (0.5, half), (0.0, side), (-0.5, half), (-0.5, -half)],
        };
        corners.iter().map(|&(x, y)| self.rotation * DVec2::new(x, y) * self.pitch_mm).collect()
    }

    /// Area of a perfect cell, mm^2.
    pub fn cell_area_mm2(&self) -> f64 {
        self.pitch_mm * self.row_pitch_mm()
    }
}

/// Where the line at height `y` enters and leaves a convex polygon. An empty chord at 0 if it misses the polygon.
pub(crate) fn chord(corners: &[DVec2], y: f64) -> [f64; 2] {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (n, &from) in corners.iter().enumerate() {
        let to = corners[(n + 1) % corners.len()];
        if (from.y - y) * (to.y - y) <= 0.0 && from.y != to.y {
            let x = from.x + (to.x - from.x) * (y - from.y) / (to.y - from.y);
            (low, high) = (low.min(x), high.max(x));
        }
    }
    if low <= high { [low, high] } else { [0.0, 0.0] }
}

#[cfg(test)]
mod tests {
    use super::super::keys::tests::bent;
    use super::*;
    use crate::camera::{Aperture, tests::seed};

    #[test]
    fn every_point_belongs_to_its_nearest_lenslet() {
        for layout in [Layout::Square, Layout::Hexagonal] {
            let lattice = seed(20, Aperture::Square, layout, 0.1).lattice();
            for n in 0..2000 {
                let point = DVec2::new((n as f64 * 0.618).fract() - 0.5, (n as f64 * 0.414).fract() - 0.5) * 1.5;
                let (i, j) = lattice.lenslet_at(point);
                let mine = lattice.centre_mm(i, j).distance(point);
                let best = lattice
                    .lenslets_within(point, DVec2::splat(0.1))
                    .map(|(_, _, centre)| centre.distance(point))
                    .fold(f64::INFINITY, f64::min);
                assert!(mine <= best + 1e-12, "{layout:?} {point}: {mine} against {best}");
                assert!(lattice.nearest_centre_mm(point).distance(lattice.centre_mm(i, j)) < 1e-12);
            }
        }
    }

    #[test]
    fn cells_tile_the_plane() {
        for layout in [Layout::Square, Layout::Hexagonal] {
            let lattice = seed(20, Aperture::Square, layout, 0.2).lattice();
            let cell = lattice.cell_mm();
            let area: f64 = (0..cell.len()).map(|n| cell[n].perp_dot(cell[(n + 1) % cell.len()])).sum::<f64>() / 2.0;
            assert!((area - lattice.cell_area_mm2()).abs() < 1e-15);
        }
    }

    #[test]
    fn departed_lenslets_hold_their_own_points() {
        for layout in [Layout::Square, Layout::Hexagonal] {
            let mut camera = seed(20, Aperture::Square, layout, 0.1);
            let straight = camera.lattice();
            camera.centres = Some(bent());
            camera.check().unwrap();
            let lattice = camera.lattice();
            for (i, j, centre) in straight.lenslets_within(DVec2::ZERO, DVec2::splat(0.8)) {
                let there = lattice.centre_mm(i, j);
                assert!(there.distance(centre + bent().departure_mm(centre)) < 1e-15);
                for near in [DVec2::ZERO, DVec2::new(0.03, -0.005), DVec2::new(-0.01, 0.03)] {
                    assert_eq!(lattice.lenslet_at(there + near), (i, j));
                    assert!(lattice.nearest_centre_mm(there + near).distance(there) < 1e-12);
                }
                let found = lattice.lenslets_within(there, DVec2::splat(0.1)).count();
                assert!((4..=16).contains(&found), "{found}");
            }
        }
    }
}
