//! The target of a calibration: a plate of dots at known depths.

use crate::key_checks::{finite, positive, wrong};
use crate::particles::Particle;
use crate::rays::{Glow, RayCount, Shape};
use glam::DVec2;
use lf_core::Refusal;
use serde::{Deserialize, Serialize};

/// A square grid of dots on a plate across the optical axis. Each depth gives one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dots {
    /// Distance from a dot to the next in its row or column, mm.
    pub spacing_mm: f64,
    /// Diameter of a dot, mm.
    pub diameter_mm: f64,
    /// Z of the plate in each image, mm.
    pub depths_mm: Vec<f64>,
    /// Counts that one dot sends through the aperture.
    #[serde(default = "default_intensity")]
    pub intensity: f64,
    /// Rotation of the grid about its centre, from x to y, rad.
    #[serde(default)]
    pub rotation_rad: f64,
    /// X and y of the grid's centre, which holds a dot, mm.
    #[serde(default)]
    pub centre_mm: [f64; 2],
    /// Half the extent of the plate along its rows and columns, mm. If absent, the plate fills the view of the sensor
    /// at the focal plane, for any rotation and centre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_size_mm: Option<[f64; 2]>,
}

pub(super) fn default_intensity() -> f64 {
    1e5
}

const MOST: f64 = 1e6;

/// Tolerance at the edge of the plate, in spacings: 3 mm are 30 spacings of 0.1 mm, but not in binary numbers.
const EDGE: f64 = 1e-9;

impl Dots {
    /// The light that a dot sends out: an even disc.
    pub fn glow(&self, rays: RayCount) -> Glow {
        Glow { shape: Shape::Disc, size_mm: 0.5 * self.diameter_mm, rays }
    }

    /// Checks the keys. The sensor sees `half_view_mm` of the focal plane to either side of the axis.
    pub(crate) fn check(&self, half_view_mm: [f64; 2]) -> Result<(), Refusal> {
        positive("dots.spacing_mm", self.spacing_mm)?;
        positive("dots.diameter_mm", self.diameter_mm)?;
        positive("dots.intensity", self.intensity)?;
        self.half_size_mm.into_iter().flatten().try_for_each(|half_mm| positive("dots.half_size_mm", half_mm))?;
        let Self { diameter_mm, spacing_mm, depths_mm, .. } = self;
        if diameter_mm >= spacing_mm {
            let found = format!("dots.diameter_mm {diameter_mm} is not below dots.spacing_mm {spacing_mm}");
            return Err(wrong(format!("{found}: the dots touch")));
        }
        finite("dots.rotation_rad", self.rotation_rad)?;
        self.centre_mm.into_iter().try_for_each(|value| finite("dots.centre_mm", value))?;
        if depths_mm.is_empty() || depths_mm.len() > 10_000 {
            return Err(wrong(format!("dots.depths_mm has {} depths, outside 1 to 10000", depths_mm.len())));
        }
        depths_mm.iter().try_for_each(|depth| finite("dots.depths_mm", *depth))?;
        let (_, DVec2 { x: columns, y: rows }) = self.steps(half_view_mm);
        let count = columns * rows;
        if count > MOST {
            let found = format!("dots asks for a grid of {columns} x {rows} = {count:.0} dots, more than {MOST:.0}");
            return Err(wrong(found));
        }
        Ok(())
    }

    /// The dots with the plate at `depth_mm`, row by row from low y in the frame of the plate. Ids count from 0 and are
    /// the same at every depth. `check` must have passed with the same `half_view_mm`.
    pub fn target(&self, half_view_mm: [f64; 2], depth_mm: f64) -> Vec<Particle> {
        let (first, count) = self.steps(half_view_mm);
        let (turn, centre) = (DVec2::from_angle(self.rotation_rad), DVec2::from(self.centre_mm));
        let seen = DVec2::from(half_view_mm) + EDGE * self.spacing_mm;
        let place = |row: u64, column: u64| {
            centre + turn.rotate((first + DVec2::new(column as f64, row as f64)) * self.spacing_mm)
        };
        (0..count.y as u64)
            .flat_map(|row| (0..count.x as u64).map(move |column| place(row, column)))
            .filter(|place| self.half_size_mm.is_some() || place.abs().cmple(seen).all())
            .zip(0..)
            .map(|(place, id)| Particle { id, place_mm: place.extend(depth_mm), intensity: self.intensity, size: 1.0 })
            .collect()
    }

    /// First dot along rows and columns, in spacings from the centre, and number of dots: those of the plate, or of the
    /// box around the view in the frame of the plate.
    fn steps(&self, half_view_mm: [f64; 2]) -> (DVec2, DVec2) {
        let (middle, reach) = match self.half_size_mm {
            Some(half) => (DVec2::ZERO, DVec2::from(half)),
            None => {
                let half = DVec2::from(half_view_mm);
                let middle = DVec2::from_angle(-self.rotation_rad).rotate(-DVec2::from(self.centre_mm));
                let turn = DVec2::from_angle(self.rotation_rad).abs();
                (middle, DVec2::new(turn.x * half.x + turn.y * half.y, turn.y * half.x + turn.x * half.y))
            }
        };
        let first = ((middle - reach) / self.spacing_mm - EDGE).ceil();
        let last = ((middle + reach) / self.spacing_mm + EDGE).floor();
        (first, (last - first + 1.0).max(DVec2::ZERO))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn dots() -> Dots {
        serde_json::from_str(r#"{"spacing_mm": 0.1, "diameter_mm": 0.03, "depths_mm": [-1, 0, 1]}"#).unwrap()
    }

    #[test]
    fn a_plain_plate_by_hand() {
        let plate = Dots { half_size_mm: Some([0.3, 0.1]), ..dots() };
        plate.check([1.0, 1.0]).unwrap();
        let target = plate.target([1.0, 1.0], 0.5);
        assert_eq!(target.len(), 7 * 3);
        for (n, dot) in target.iter().enumerate() {
            let place = DVec3::new(((n % 7) as f64 - 3.0) * 0.1, ((n / 7) as f64 - 1.0) * 0.1, 0.5);
            assert!(dot.place_mm.distance(place) < 1e-12, "{dot:?}");
            assert_eq!((dot.id, dot.intensity, dot.size), (n as u64, 1e5, 1.0));
        }
    }

    #[test]
    fn a_dot_is_the_same_at_every_depth() {
        let plate = Dots { rotation_rad: 0.2, centre_mm: [0.04, -0.03], ..dots() };
        let [near, far] = [1.0, -1.0].map(|depth| plate.target([2.0, 1.0], depth));
        assert_eq!(near.len(), far.len());
        for (a, b) in near.iter().zip(&far) {
            assert_eq!((a.id, a.place_mm.truncate()), (b.id, b.place_mm.truncate()));
            assert_eq!((a.place_mm.z, b.place_mm.z), (1.0, -1.0));
        }
        assert!(near.iter().enumerate().all(|(n, dot)| dot.id == n as u64));
    }

    /// A plate without a size holds exactly the dots of a larger plate that lie in the view, for any rotation and
    /// centre.
    #[test]
    fn without_a_size_the_plate_fills_the_view() {
        for (rotation_rad, centre_mm) in [(0.0, [0.0; 2]), (0.3, [0.0; 2]), (-2.2, [0.37, -5.0]), (1.6, [9.0, 0.02])] {
            let plate = Dots { rotation_rad, centre_mm, ..dots() };
            let view = [0.91, 0.52];
            plate.check(view).unwrap();
            let all = Dots { half_size_mm: Some([11.0; 2]), ..plate.clone() }.target(view, 0.0);
            let in_view = |dot: &&Particle| dot.place_mm.x.abs() <= view[0] && dot.place_mm.y.abs() <= view[1];
            let wanted: Vec<DVec3> = all.iter().filter(in_view).map(|dot| dot.place_mm).collect();
            let found: Vec<DVec3> = plate.target(view, 0.0).iter().map(|dot| dot.place_mm).collect();
            assert!(wanted.len() > 150 && found.len() == wanted.len(), "{} of {}", found.len(), wanted.len());
            assert!(found.iter().zip(&wanted).all(|(a, b)| a.distance(*b) < 1e-12));
        }
    }

    #[test]
    fn the_centre_holds_a_dot_and_the_grid_rotates_about_it_from_x_to_y() {
        let plate = Dots { rotation_rad: 0.1, centre_mm: [0.2, -0.1], ..dots() };
        let target = plate.target([1.0, 1.0], 0.0);
        let at = |place: DVec3| target.iter().find(|dot| dot.place_mm.distance(place) < 1e-12);
        let centre = at(DVec3::new(0.2, -0.1, 0.0)).unwrap();
        let next = at(DVec3::new(0.2 + 0.1 * 0.1f64.cos(), -0.1 + 0.1 * 0.1f64.sin(), 0.0)).unwrap();
        assert_eq!(next.id, centre.id + 1);
    }

    #[test]
    fn a_wrong_key_is_named() {
        let refused = |plate: Dots| plate.check([3.0, 2.0]).unwrap_err().found;
        assert!(dots().check([3.0, 2.0]).is_ok());
        assert!(refused(Dots { spacing_mm: f64::NAN, ..dots() }).contains("dots.spacing_mm is NaN"));
        assert!(refused(Dots { diameter_mm: 0.0, ..dots() }).contains("dots.diameter_mm is 0"));
        assert!(refused(Dots { diameter_mm: 0.1, ..dots() }).contains("the dots touch"));
        assert!(refused(Dots { intensity: -1.0, ..dots() }).contains("dots.intensity is -1"));
        assert!(refused(Dots { half_size_mm: Some([1.0, 0.0]), ..dots() }).contains("dots.half_size_mm is 0"));
        assert!(refused(Dots { rotation_rad: f64::INFINITY, ..dots() }).contains("dots.rotation_rad is inf"));
        assert!(refused(Dots { centre_mm: [0.0, f64::NAN], ..dots() }).contains("dots.centre_mm is NaN"));
        assert!(refused(Dots { depths_mm: vec![], ..dots() }).contains("dots.depths_mm has 0 depths"));
        assert!(refused(Dots { depths_mm: vec![0.0, f64::NAN], ..dots() }).contains("dots.depths_mm is NaN"));
        let dense = Dots { spacing_mm: 0.001, diameter_mm: 0.0005, ..dots() };
        assert_eq!(refused(dense), "dots asks for a grid of 6001 x 4001 = 24010001 dots, more than 1000000");
        assert!(serde_json::from_str::<Dots>(r#"{"spacing": 1}"#).unwrap_err().to_string().contains("unknown field"));
    }
}
