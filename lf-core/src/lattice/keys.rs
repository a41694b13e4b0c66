//! The keys `microlenses` and `centres` of a camera: a perfect lattice, and the measured departure of lenslets from it.

use crate::Refusal;
use glam::DVec2;
use serde::{Deserialize, Serialize};

/// How the lenslets are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Rows and columns one pitch apart.
    Square,
    /// Rows `pitch sqrt(3)/2` apart, odd rows shifted by half a pitch.
    Hexagonal,
}

/// The perfect lattice of the microlenses. Lenslet (i, j) has its centre at `offset_mm + R(rotation_rad) q`, where q is
/// `((i + 1/2) p, (j + 1/2) p)` in a square lattice and `((i + (j odd)/2) p, j p sqrt(3)/2)` in a hexagonal one; p is
/// the pitch, and R turns from x towards y. The sensor decides which lenslets are seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Microlenses {
    /// Square or hexagonal.
    pub layout: Layout,
    /// Distance p between neighbouring lenslets, mm.
    pub pitch_mm: f64,
    /// Focal length, mm; also the distance to the sensor if `gap_mm` is absent.
    pub focal_length_mm: f64,
    /// Rotation of the lattice about `offset_mm`, from x towards y, rad.
    pub rotation_rad: f64,
    /// Origin of the lattice on the array, mm from the optical axis.
    pub offset_mm: [f64; 2],
    /// Distance from the array to the sensor on the axis, mm; the focal length if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap_mm: Option<f64>,
}

/// Smooth departure of the lenslets' centres from the perfect lattice, as measured. A lenslet whose perfect centre is
/// c, mm from the middle of the sensor, is at c + (x, y), where x and y are polynomials in q = c / `radius_mm`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Centres {
    /// Scale of the polynomials, mm. Half the sensor's diagonal keeps coefficients as small as the departures.
    pub radius_mm: f64,
    /// Departure along x, mm: coefficients of q_x, q_y, q_x^2, q_x q_y, q_y^2, q_x^3 ... up to a full degree.
    pub x_mm: Vec<f64>,
    /// Departure along y, mm: as many coefficients, in the same order.
    pub y_mm: Vec<f64>,
}

/// Highest degree of the polynomials.
pub const MOST_DEGREE: usize = 5;

/// Beyond this many radii the departure stays constant, since nothing was measured there.
const FARTHEST: f64 = 1.5;

/// Largest gradient of a departure; a larger one describes another lattice.
pub(super) const STEEPEST: f64 = 0.2;

/// Number of coefficients of a polynomial of `degree`, without the constant.
pub const fn terms(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2 - 1
}

impl Centres {
    /// Degree of the polynomials. None if the number of coefficients fits no degree.
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

    /// Upper bound of the departure's gradient, mm per mm.
    pub(super) fn steepest(&self) -> f64 {
        let bound = |coefficients: &[f64]| {
            let mut rest = coefficients.iter();
            let mut term = |degree: usize| {
                let sum: f64 = rest.by_ref().take(degree + 1).map(|c| c.abs()).sum();
                sum * degree as f64 * FARTHEST.powi(degree as i32 - 1)
            };
            (1..=MOST_DEGREE).map(&mut term).sum::<f64>()
        };
        bound(&self.x_mm).max(bound(&self.y_mm)) / self.radius_mm
    }

    /// Checks that the polynomials are complete, and their gradient at most 0.2.
    pub fn check(&self) -> Result<(), Refusal> {
        let (x, y) = (self.x_mm.len(), self.y_mm.len());
        let found = || format!("centres has {x} and {y} coefficients");
        let wanted = "wanted twice the 2, 5, 9, 14 or 20 of a full degree";
        Refusal::unless(x == y && self.degree().is_some(), found, wanted)?;
        let radius = self.radius_mm;
        let found = || format!("centres.radius_mm is {radius}");
        Refusal::unless(radius.is_finite() && radius > 0.0, found, "wanted a positive number")?;
        if let Some(number) = self.x_mm.iter().chain(&self.y_mm).find(|number| !number.is_finite()) {
            return Err(Refusal::new(format!("centres has a coefficient of {number}"), "wanted finite numbers"));
        }
        let steepest = self.steepest();
        let found = || format!("centres depart by up to {steepest:.3} mm per mm");
        Refusal::unless(steepest <= STEEPEST, found, format!("wanted at most {STEEPEST}, a departure from one lattice"))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A departure of several pixels with every term: 20 lenslets of 0.077 mm, 0.77 mm to a side.
    pub(crate) fn bent() -> Centres {
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
    fn departures_that_are_no_lattice_are_refused() {
        let refused = |change: &dyn Fn(&mut Centres)| {
            let mut centres = bent();
            change(&mut centres);
            centres.check().unwrap_err().found
        };
        assert!(refused(&|c| c.x_mm.truncate(3)).contains("3 and 9 coefficients"));
        assert!(refused(&|c| c.radius_mm = 0.0).contains("radius_mm is 0"));
        assert!(refused(&|c| c.y_mm[0] = 0.5).contains("mm per mm"));
        assert!(refused(&|c| c.y_mm[0] = f64::NAN).contains("coefficient of NaN"));
    }
}
