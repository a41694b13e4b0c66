//! The blades of an iris, which leave a polygon of a round stop.
//!
//! A closed iris is a regular polygon, and each side is an arc: photographic lenses have blades that are bent towards a
//! circle. The disc of the main stop goes through the corners, so the f-number of such a camera is that of the corners.
//! Light at a side depends on where it lies within a pixel, so pixels that a blade touches are left out, as those of a
//! second stop are ([`crate::Camera::cut_pixels`]).

use super::second_stop::Disc;
use crate::Refusal;
use glam::DVec2;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// An iris has at least this many blades, and at most.
const COUNTS: [u32; 2] = [3, 40];
/// A side counts as bent at least this much, over the radius: a straight one is an arc of a very large disc.
const LEAST_BEND: f64 = 1e-6;

/// A regular polygon with its corners on the rim of the round stop, as lenslet images show it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blades {
    /// Number of sides.
    pub count: u32,
    /// Direction of a corner from the middle of a lenslet image, rad, from the columns' axis to the rows'.
    pub turn_rad: f64,
    /// Distance of the middle of a side from the centre, over that of the corners: cos(pi / count) if blades are
    /// straight, 1 for a circle.
    pub apothem: f64,
}

impl Blades {
    /// The apothem of straight blades.
    pub fn straight(count: u32) -> f64 {
        (PI / f64::from(count)).cos()
    }

    /// One disc for each blade, beside the middle of a lenslet image of this half width, px: light passes inside all.
    pub fn discs(&self, half_px: f64) -> impl Iterator<Item = Disc> {
        let Self { count, turn_rad, apothem } = *self;
        let back = self.back();
        (0..count).map(move |side| {
            let towards = DVec2::from_angle(turn_rad + PI * f64::from(2 * side + 1) / f64::from(count));
            Disc { middle_px: -back * half_px * towards, radius_px: (apothem + back) * half_px }
        })
    }

    /// The discs in the aperture, for half its width: lenslet images show it upside down. Lengths are in the unit of
    /// `half`.
    pub fn aperture_discs(&self, half: f64) -> impl Iterator<Item = Disc> {
        self.discs(half).map(|disc| Disc { middle_px: -disc.middle_px, ..disc })
    }

    /// The polygon's rim, counter-clockwise, for a half width of 1: each side in `parts` chords.
    pub fn rim(&self, parts: u32) -> Vec<DVec2> {
        let discs: Vec<Disc> = self.discs(1.0).collect();
        let each = PI * 2.0 / f64::from(self.count * parts);
        let point = |n: u32| {
            let direction = DVec2::from_angle(self.turn_rad + each * f64::from(n));
            discs[(n / parts) as usize].reach_px(direction) * direction
        };
        (0..self.count * parts).map(point).collect()
    }

    /// The polygon's area over that of the disc through its corners: for each side a sector of its arc's disc, less the
    /// triangle from that disc's middle to the polygon's and a corner.
    pub fn area(&self) -> f64 {
        let (back, (sin, cos)) = (self.back(), (PI / f64::from(self.count)).sin_cos());
        let radius = self.apothem + back;
        f64::from(self.count) * (radius * radius * sin.atan2(cos + back) - back * sin) / PI
    }

    /// Distance from the polygon's middle to that of a side's arc, on the other side, over the half width: the arc goes
    /// through both corners and through the middle of the side.
    fn back(&self) -> f64 {
        let bend = (self.apothem - Self::straight(self.count)).max(LEAST_BEND);
        (1.0 - self.apothem * self.apothem) / (2.0 * bend)
    }

    pub(super) fn check(&self) -> Result<(), Refusal> {
        let Self { count, turn_rad, apothem } = *self;
        let [fewest, most] = COUNTS;
        let wanted = format!("wanted {fewest} to {most}");
        Refusal::unless((fewest..=most).contains(&count), || format!("blades.count is {count}"), wanted)?;
        Refusal::unless(turn_rad.is_finite(), || "blades.turn_rad is not finite", "wanted a finite number")?;
        let straight = Self::straight(count);
        let wanted = format!("wanted {straight:.4}, straight blades, to 1, a circle");
        let is_within = apothem > straight - 1e-3 && apothem <= 1.0;
        Refusal::unless(is_within, || format!("blades.apothem is {apothem}"), wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: a hexagon of straight blades with a corner along x has its sides at 30 degrees, sqrt(3) / 2 away.
    #[test]
    fn discs_and_rim_are_those_of_a_hexagon() {
        let hexagon = Blades { count: 6, turn_rad: 0.0, apothem: Blades::straight(6) };
        hexagon.check().unwrap();
        let reach = |degrees: f64| {
            let direction = DVec2::from_angle(degrees.to_radians());
            hexagon.discs(10.0).map(|disc| disc.reach_px(direction)).fold(f64::INFINITY, f64::min)
        };
        for (degrees, wanted) in [(0.0, 10.0), (30.0, 8.660254), (45.0, 8.965755), (90.0, 8.660254), (120.0, 10.0)] {
            assert!((reach(degrees) - wanted).abs() < 1e-3, "{degrees}: {}", reach(degrees));
        }
        let triangle = Blades { count: 3, turn_rad: 0.0, apothem: 0.5 };
        let passes = |x: f64| triangle.aperture_discs(1.0).all(|disc| disc.holds(DVec2::new(x, 0.0)));
        assert!(passes(-0.9) && !passes(0.6));
        assert!((hexagon.area() - 1.5 * 3f64.sqrt() / PI).abs() < 1e-5);
        for (n, corner) in hexagon.rim(1).iter().enumerate() {
            assert!(corner.distance(DVec2::from_angle(PI / 3.0 * n as f64)) < 1e-5);
        }
    }

    /// Bent sides meet at the corners and reach the apothem between them.
    #[test]
    fn bent_blades_are_arcs() {
        let iris = Blades { count: 9, turn_rad: 0.2, apothem: 0.97 };
        let rim = iris.rim(4);
        assert_eq!(rim.len(), 36);
        for (n, point) in rim.iter().enumerate() {
            let wanted = [1.0, f64::NAN, 0.97, f64::NAN][n % 4];
            assert!(wanted.is_nan() || (point.length() - wanted).abs() < 1e-9, "{n}: {}", point.length());
            assert!(point.length() > 0.97 - 1e-9 && point.length() < 1.0 + 1e-9);
        }
        assert!((rim[2].to_angle() - (0.2 + PI / 9.0)).abs() < 1e-9);
        let circle = Blades { apothem: 1.0, ..iris };
        assert!(circle.rim(4).iter().all(|point| (point.length() - 1.0).abs() < 1e-9));
    }

    #[test]
    fn a_polygon_that_cannot_be_is_refused() {
        let iris = Blades { count: 6, turn_rad: 0.0, apothem: 0.9 };
        for (wrong, key) in [
            (Blades { count: 2, ..iris }, "count"),
            (Blades { turn_rad: f64::NAN, ..iris }, "turn_rad"),
            (Blades { apothem: 0.8, ..iris }, "apothem"),
            (Blades { apothem: 1.1, ..iris }, "apothem"),
        ] {
            assert!(wrong.check().unwrap_err().found.contains(key), "{wrong:?}");
        }
    }
}
