//! The lattice of the microlenses: which lenslet holds a point of the array, and where its centre is.

use crate::camera::{Layout, Microlenses};
use glam::{DMat2, DVec2};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// Smooth departure of the lenslets' centres from the perfect lattice, as measured. A lenslet whose perfect centre is c, mm
/// from the sensor's middle, is at c + (x, y), polynomials in q = c / `radius_mm`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Centres {
    /// The length that places are divided by, mm; half the sensor's diagonal keeps coefficients within the frame's
    /// departures.
    pub radius_mm: f64,
    /// Departure along x, mm: coefficients of q_x, q_y, q_x^2, q_x q_y, q_y^2, q_x^3, q_x^2 q_y ... to a full degree of
    /// [`MOST_DEGREE`] at most.
    pub x_mm: Vec<f64>,
    /// Departure along y, mm: as many coefficients.
    pub y_mm: Vec<f64>,
}

/// The highest degree of a departure.
pub const MOST_DEGREE: usize = 5;

/// A departure is the same beyond this many radii, where nothing was measured.
const FARTHEST: f64 = 1.5;

/// Largest growth of a departure per length that is a departure and no other lattice.
const STEEPEST: f64 = 0.2;

/// Steps that take a point back to the perfect lattice; each multiplies the error by the departure's growth per length,
/// some thousandths for real arrays and [`STEEPEST`] at most.
const BACK_STEPS: usize = 3;

/// Coefficients of a departure of a degree.
pub const fn terms(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2 - 1
}

impl Centres {
    /// Degree of the polynomials; none where the number of coefficients is no full degree's.
    pub fn degree(&self) -> Option<usize> {
        (1..=MOST_DEGREE).find(|degree| terms(*degree) == self.x_mm.len())
    }

    /// Departure of the lenslet whose perfect centre is `centre_mm`, mm.
    pub fn departure_mm(&self, centre_mm: DVec2) -> DVec2 {
        let q = (centre_mm / self.radius_mm).clamp_length_max(FARTHEST);
        let (mut x_powers, mut y_powers) = ([1.0; MOST_DEGREE + 1], [1.0; MOST_DEGREE + 1]);
        for n in 1..=MOST_DEGREE {
            x_powers[n] = x_powers[n - 1] * q.x;
            y_powers[n] = y_powers[n - 1] * q.y;
        }
        let mut sum = DVec2::ZERO;
        let mut coefficients = self.x_mm.iter().zip(&self.y_mm);
        for degree in 1..=MOST_DEGREE {
            for (b, (x, y)) in coefficients.by_ref().take(degree + 1).enumerate() {
                sum += x_powers[degree - b] * y_powers[b] * DVec2::new(*x, *y);
            }
        }
        sum
    }
    /// The most that a departure grows by per length.
    fn steepest(&self) -> f64 {
        let of = |coefficients: &[f64]| {
            let mut rest = coefficients.iter();
            (1..=MOST_DEGREE)
                .map(|degree| {
                    let sum: f64 = rest.by_ref().take(degree + 1).map(|c| c.abs()).sum();
                    sum * degree as f64 * FARTHEST.powi(degree as i32 - 1)
                })
                .sum::<f64>()
        };
        of(&self.x_mm).max(of(&self.y_mm)) / self.radius_mm
    }

    /// Checks that the polynomials are whole and gentle.
    ///
    /// # Errors
    /// Says what is wrong.
    pub fn check(&self) -> Result<(), String> {
        let (x, y) = (self.x_mm.len(), self.y_mm.len());
        if x != y || self.degree().is_none() {
            return Err(format!(
                "centres has {x} and {y} coefficients, not twice the 2, 5, 9, 14 or 20 of a full degree"
            ));
        }
        if !(self.radius_mm.is_finite() && self.radius_mm > 0.0) {
            return Err(format!("centres.radius_mm is {}, not a positive length", self.radius_mm));
        }
        if let Some(number) = self.x_mm.iter().chain(&self.y_mm).find(|number| !number.is_finite()) {
            return Err(format!("centres has a coefficient of {number}"));
        }
        let steepest = self.steepest();
        if steepest > STEEPEST {
            return Err(format!("centres depart by up to {steepest:.3} mm per mm, which is no longer one lattice"));
        }
        Ok(())
    }
}

/// Lenslet centres: `offset + R(rotation) q`, where q is `((i + 1/2) p, (j + 1/2) p)` for a square lattice and
/// `((i + (j odd)/2) p, j p sqrt(3)/2)` for a hexagonal one; and the measured departure from there. Without bounds: the sensor decides what is
/// seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    layout: Layout,
    pitch_mm: f64,
    offset_mm: DVec2,
    turn: DMat2,
    centres: Option<Centres>,
    /// The most that departures grow by per length.
    steepest: f64,
}

impl Lattice {
    /// The lattice of a camera's microlenses; see [`crate::camera::Camera::lattice`].
    pub(crate) fn new(microlenses: &Microlenses, centres: Option<&Centres>) -> Self {
        Self {
            layout: microlenses.layout,
            pitch_mm: microlenses.pitch_mm,
            offset_mm: DVec2::from(microlenses.offset_mm),
            turn: DMat2::from_angle(microlenses.rotation_rad),
            centres: centres.cloned(),
            steepest: centres.map_or(0.0, Centres::steepest),
        }
    }

    /// Whether lenslets depart from the perfect lattice.
    pub fn departs(&self) -> bool {
        self.centres.is_some()
    }

    /// From a centre of the perfect lattice to the lenslet's, mm.
    #[inline]
    pub fn departed(&self, perfect_mm: DVec2) -> DVec2 {
        match &self.centres {
            None => perfect_mm,
            Some(centres) => perfect_mm + centres.departure_mm(perfect_mm),
        }
    }

    /// From a place of the array to where it would be if no lenslet departed, mm.
    #[inline]
    pub fn perfect(&self, point_mm: DVec2) -> DVec2 {
        let Some(centres) = &self.centres else { return point_mm };
        let mut perfect = point_mm;
        for _ in 0..BACK_STEPS {
            perfect = point_mm - centres.departure_mm(perfect);
        }
        perfect
    }

    /// Distance between rows of lenslets, mm.
    pub fn row_pitch_mm(&self) -> f64 {
        match self.layout {
            Layout::Square => self.pitch_mm,
            Layout::Hexagonal => self.pitch_mm * 0.75f64.sqrt(),
        }
    }

    /// Shift of row `j` along the row, in pitches.
    #[inline]
    fn row_shift(&self, j: i64) -> f64 {
        match self.layout {
            Layout::Square => 0.5,
            Layout::Hexagonal => 0.5 * (j & 1) as f64,
        }
    }

    /// Distance of row 0 from the offset, in row pitches.
    #[inline]
    fn first_row(&self) -> f64 {
        match self.layout {
            Layout::Square => 0.5,
            Layout::Hexagonal => 0.0,
        }
    }

    /// Centre of lenslet (i, j), mm.
    #[inline]
    pub fn centre_mm(&self, i: i64, j: i64) -> DVec2 {
        let along = (i as f64 + self.row_shift(j)) * self.pitch_mm;
        let across = (j as f64 + self.first_row()) * self.row_pitch_mm();
        self.departed(self.offset_mm + self.turn * DVec2::new(along, across))
    }

    /// The lenslet whose cell holds a point of the array: the nearest centre, where lenslets depart that of the perfect
    /// lattice.
    #[inline]
    pub fn lenslet_at(&self, point_mm: DVec2) -> (i64, i64) {
        let q = self.turn.transpose() * (self.perfect(point_mm) - self.offset_mm);
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

    /// Centre of the lenslet whose cell holds a point of the array, mm; as [`Lattice::lenslet_at`], without branches.
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
        // By components, which compilers turn into arithmetic on several points at once.
        let (cos, sin) = (self.turn.x_axis.x, self.turn.x_axis.y);
        let (x, y) = (point_mm.x - self.offset_mm.x, point_mm.y - self.offset_mm.y);
        let (qx, qy) = (cos * x + sin * y, cos * y - sin * x);
        let per_pitch = 1.0 / self.pitch_mm;
        let (cx, cy) = match self.layout {
            Layout::Square => {
                (((qx * per_pitch).floor() + 0.5) * self.pitch_mm, ((qy * per_pitch).floor() + 0.5) * self.pitch_mm)
            }
            Layout::Hexagonal => {
                // The nearest of the row below, and of that above, whose shift is the other one.
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

    /// Coordinates (along a row in pitches, across rows in row pitches) of a point of the perfect lattice, without the rows'
    /// shift.
    fn place(&self, point_mm: DVec2) -> DVec2 {
        let q = self.turn.transpose() * (point_mm - self.offset_mm);
        DVec2::new(q.x / self.pitch_mm, q.y / self.row_pitch_mm())
    }

    /// The lenslets whose centres lie within a box of half sides `reach_mm` about a point, row by row.
    pub fn lenslets_within(&self, point_mm: DVec2, reach_mm: DVec2) -> impl Iterator<Item = (i64, i64, DVec2)> + '_ {
        let rows = self.rows_within(self.perfect(point_mm), reach_mm);
        rows.flat_map(move |(j, lenslets)| lenslets.map(move |i| (i, j, self.centre_mm(i, j))))
    }

    /// For each row j of the lattice its lenslets whose centres lie within a box of half sides `reach_mm` about a place of
    /// the perfect lattice, and perhaps some about it.
    #[inline]
    pub fn rows_within(
        &self,
        perfect_mm: DVec2,
        reach_mm: DVec2,
    ) -> impl Iterator<Item = (i64, RangeInclusive<i64>)> + use<> {
        let q = self.place(perfect_mm);
        // Departures that differ within the box can bring a lenslet in.
        let reach_mm = reach_mm + DVec2::splat(self.steepest * reach_mm.max_element());
        // A box turned with the lattice that holds the box asked for.
        let (sin, cos) = (self.turn.x_axis.y.abs(), self.turn.x_axis.x.abs());
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

    /// Corners of a lenslet's cell relative to its centre, in order around it, mm; the perfect lattice's.
    pub fn cell_mm(&self) -> Vec<DVec2> {
        let corner = |x: f64, y: f64| self.turn * DVec2::new(x, y) * self.pitch_mm;
        match self.layout {
            Layout::Square => [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, y)| corner(x, y)).to_vec(),
            Layout::Hexagonal => {
                let (side, flat) = (1.0 / 3f64.sqrt(), 0.5);
                [
                    (0.0, -side),
                    (flat, -side / 2.0),
                    (flat, side / 2.0),
                    (0.0, side),
                    (-flat, side / 2.0),
                    (-flat, -side / 2.0),
                ]
                .map(|(x, y)| corner(x, y))
                .to_vec()
            }
        }
    }

    /// Area of a cell, mm^2.
    pub fn cell_area_mm2(&self) -> f64 {
        self.pitch_mm * self.row_pitch_mm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Aperture;
    use crate::camera::tests::seed;

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

    /// A departure of several pixels with every term: 20 lenslets of 0.077 mm, 0.77 mm to a side.
    fn bent() -> Centres {
        let x_mm = vec![0.004, -0.003, 0.002, 0.001, -0.002, 0.0015, -0.001, 0.0005, 0.001];
        let y_mm = x_mm.iter().rev().copied().collect();
        Centres { radius_mm: 1.1, x_mm, y_mm }
    }

    #[test]
    fn departures_are_their_polynomial() {
        // By hand at q = (1, 0) and (0, 1): the sums of the pure powers; at (1/2, 1/2) powers of a half.
        let centres = bent();
        assert_eq!(centres.degree(), Some(3));
        let at = |x: f64, y: f64| centres.departure_mm(1.1 * DVec2::new(x, y));
        assert!((at(1.0, 0.0).x - (0.004 + 0.002 + 0.0015)).abs() < 1e-15);
        assert!((at(0.0, 1.0).x - (-0.003 - 0.002 + 0.001)).abs() < 1e-15);
        let half = 0.5 * 0.001 + 0.25 * 0.001 + 0.125 * 0.002;
        assert!((at(0.5, 0.5).x - half).abs() < 1e-15);
        assert_eq!(at(30.0, 0.0), at(1.5, 0.0));
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

    #[test]
    fn departures_that_are_no_lattice_are_refused() {
        let refused = |change: &dyn Fn(&mut Centres)| {
            let mut centres = bent();
            change(&mut centres);
            centres.check().unwrap_err()
        };
        assert!(refused(&|c| c.x_mm.truncate(3)).contains("3 and 9 coefficients"));
        assert!(refused(&|c| c.radius_mm = 0.0).contains("radius_mm is 0"));
        assert!(refused(&|c| c.y_mm[0] = 0.5).contains("mm per mm"));
        assert!(refused(&|c| c.y_mm[0] = f64::NAN).contains("coefficient of NaN"));
    }
}
