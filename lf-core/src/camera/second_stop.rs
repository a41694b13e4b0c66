//! A second stop, such as the rim of a lens barrel, as white images show it.
//!
//! Under each lenslet it has an image too: a disc, displaced in proportion to the lenslet's distance from the middle of
//! the sensor (cat's eye). Only light inside both discs, or inside the disc and the square of the main stop, arrives.
//! How much of a particle's light that is depends on where its light lies within a pixel, so pixels at the rim of the
//! second disc and beyond are left out ([`crate::Camera::cut_pixels`]): the others see all that the main stop lets
//! through.

use crate::Refusal;
use glam::DVec2;
use serde::{Deserialize, Serialize};

/// A disc that cuts into the lenslet images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondStop {
    /// Diameter of its image, px.
    pub diameter_px: f64,
    /// Its displacement against the lenslet image, divided by that image's distance from the middle of the sensor.
    pub slope: f64,
    /// Its displacement in the middle of the sensor, px.
    #[serde(default)]
    pub aside_px: [f64; 2],
}

/// Number of directions in which [`Disc::cuts`] looks for light that the disc takes away.
const DIRECTIONS: i32 = 9;

/// A disc beside the middle of a lenslet image, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Its middle, from that of the lenslet image.
    pub middle_px: DVec2,
    /// Its radius.
    pub radius_px: f64,
}

impl Disc {
    /// Whether a place is inside.
    #[inline(always)]
    pub fn holds(&self, place_px: DVec2) -> bool {
        place_px.distance_squared(self.middle_px) <= self.radius_px * self.radius_px
    }

    /// Distance from the middle of the lenslet image to the rim of the disc in a direction; 0 if the ray misses it.
    pub fn reach_px(&self, direction: DVec2) -> f64 {
        let across = self.middle_px.perp_dot(direction);
        let half = self.radius_px * self.radius_px - across * across;
        if half > 0.0 { self.middle_px.dot(direction) + half.sqrt() } else { 0.0 }
    }

    /// Whether the disc takes light of the main stop from within `near_px` of the place at `from_px` from the middle of
    /// the lenslet image. `main_reach_px` gives the distance of the main stop's rim in a direction.
    pub fn cuts(&self, main_reach_px: impl Fn(DVec2) -> f64, from_px: DVec2, near_px: f64) -> bool {
        // Only places near the rim of the disc or beyond it can be cut.
        if from_px.distance(self.middle_px) <= self.radius_px - near_px {
            return false;
        }
        let is_beside = self.middle_px.length() >= self.radius_px;
        let away = from_px.length();
        let half = if away > near_px { (near_px / away).asin() } else { std::f64::consts::PI };
        let middle = from_px.try_normalize().unwrap_or(DVec2::X);
        (0..DIRECTIONS).any(|n| {
            let turn = half * (f64::from(2 * n) / f64::from(DIRECTIONS - 1) - 1.0);
            let direction = middle.rotate(DVec2::from_angle(turn));
            let (along, across) = (away * turn.cos(), away * turn.sin());
            let chord = (near_px * near_px - across * across).max(0.0).sqrt();
            let (second, main) = (if is_beside { 0.0 } else { self.reach_px(direction) }, main_reach_px(direction));
            second < main && along + chord > second && along - chord < main
        })
    }
}

impl SecondStop {
    /// Its disc for the lenslet that is imaged at `from_middle_px` from the middle of the sensor.
    pub fn disc(&self, from_middle_px: DVec2) -> Disc {
        let middle_px = DVec2::from(self.aside_px) + self.slope * from_middle_px;
        Disc { middle_px, radius_px: 0.5 * self.diameter_px }
    }

    pub(super) fn check(&self) -> Result<(), Refusal> {
        let Self { diameter_px, slope, aside_px } = *self;
        let found = || format!("second_stop.diameter_px is {diameter_px}");
        Refusal::unless(diameter_px.is_finite() && diameter_px > 0.0, found, "wanted more than 0")?;
        let is_finite = [slope, aside_px[0], aside_px[1]].iter().all(|number| number.is_finite());
        Refusal::unless(is_finite, || "a number of second_stop is not finite", "wanted finite numbers")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A place is cut if a point near it lies within the main stop and beyond the disc.
    #[test]
    fn a_disc_cuts_what_points_say() {
        let near = 0.8;
        let points: Vec<DVec2> = (0..6400)
            .map(|n| (DVec2::new(f64::from(n % 80), f64::from(n / 80)) / 39.5 - 1.0) * near)
            .filter(|point| point.length() < near)
            .collect();
        for (middle, radius_px) in [((0.5, 0.2), 7.4), ((-1.5, 0.0), 7.4), ((3.0, 2.0), 6.5), ((0.2, 0.0), 8.0)] {
            let disc = Disc { middle_px: middle.into(), radius_px };
            let mut wrong = 0;
            for n in 0..400 {
                let from = DVec2::new(f64::from(n % 20), f64::from(n / 20)) * 0.8 - 7.6;
                let is_taken = |q: DVec2| q.length() < 7.0 && q.distance(disc.middle_px) > radius_px;
                let by_points = points.iter().any(|point| is_taken(from + *point));
                wrong += i32::from(disc.cuts(|_| 7.0, from, near) != by_points);
            }
            // Places whose circle just touches what is taken.
            assert!(wrong <= 8, "{disc:?}: {wrong}");
        }
        let whole = Disc { middle_px: DVec2::new(0.3, 0.0), radius_px: 7.4 };
        assert!(!whole.cuts(|_| 7.0, DVec2::new(-6.9, 0.0), near));
    }
}
