//! Velocity fields, and the paths of particles through them.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A steady velocity field; one unit of time is the interval between two frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Flow {
    /// The same displacement everywhere, mm a frame.
    Uniform {
        /// Displacement along x, y, z, mm.
        displacement_mm: [f64; 3],
    },
    /// Cases A1 to A4 (u) and B1 to B4 (w) of Shi, Ding, New & Soria (2017), section 4.
    Wave {
        /// `A1` ... `A4`, `B1` ... `B4`.
        case: Case,
        /// Cycles of the velocity across the volume: a quarter is 0.25.
        omega: f64,
        /// Greatest displacement, px at the focal plane a frame.
        amplitude_px: f64,
    },
}

/// One of the paper's eight oscillating fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub enum Case {
    A1,
    A2,
    A3,
    A4,
    B1,
    B2,
    B3,
    B4,
}

impl Flow {
    /// Checks what the types do not.
    ///
    /// # Errors
    /// Names the key.
    pub fn check(&self) -> Result<(), String> {
        let finite = match self {
            Self::Uniform { displacement_mm } => displacement_mm.iter().all(|d| d.is_finite()),
            Self::Wave { omega, amplitude_px, .. } => omega.is_finite() && amplitude_px.is_finite(),
        };
        if finite { Ok(()) } else { Err("flow has a number that is not finite".to_string()) }
    }

    /// The field in a volume.
    pub fn in_volume(&self, bounds_mm: [[f64; 2]; 3], pixel_mm: f64) -> Velocity {
        match *self {
            Self::Uniform { displacement_mm } => {
                Velocity { amplitude_mm: DVec3::from(displacement_mm), wavenumber: DVec3::ZERO, centre_mm: DVec3::ZERO }
            }
            Self::Wave { case, omega, amplitude_px } => {
                let extent = DVec3::from(bounds_mm.map(|[low, high]| high - low));
                let centre_mm = DVec3::from(bounds_mm.map(|[low, high]| 0.5 * (low + high)));
                let amplitude = amplitude_px * pixel_mm;
                let along_x = matches!(case, Case::A1 | Case::A2 | Case::A3 | Case::A4);
                // Printed: k = 2 pi / (omega L), and sqrt(2) omega L over two axes with L sqrt(2) times longer. The text
                // has omega count cycles across the volume, so omega stands above: departures in the README.
                let cycles = match case {
                    Case::A1 | Case::B1 => DVec3::X,
                    Case::A2 | Case::B2 => DVec3::new(0.5, 0.5, 0.0),
                    Case::A3 | Case::B3 => DVec3::new(0.5, 0.0, 0.5),
                    Case::A4 | Case::B4 => DVec3::Z,
                };
                Velocity {
                    amplitude_mm: amplitude * if along_x { DVec3::X } else { DVec3::Z },
                    wavenumber: std::f64::consts::TAU * omega * cycles / extent,
                    centre_mm,
                }
            }
        }
    }
}

/// v(r) = a cos(k . (r - centre)): the real part of the paper's exponential, its crest in the middle of the volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Velocity {
    amplitude_mm: DVec3,
    wavenumber: DVec3,
    centre_mm: DVec3,
}

/// Steps to a unit of time; a quarter of the fastest of the paper's waves errs by less than 1e-6 px.
const STEPS: u32 = 8;

impl Velocity {
    /// No motion.
    pub const REST: Self = Self { amplitude_mm: DVec3::ZERO, wavenumber: DVec3::ZERO, centre_mm: DVec3::ZERO };

    /// Velocity at a place, mm a frame.
    pub fn at(&self, place_mm: DVec3) -> DVec3 {
        self.amplitude_mm * self.wavenumber.dot(place_mm - self.centre_mm).cos()
    }

    /// How far a particle can go in a unit of time along each axis, mm.
    pub fn reach_mm(&self) -> DVec3 {
        self.amplitude_mm.abs()
    }

    /// Where a particle is after `time` (may be negative), by the classical fourth-order Runge-Kutta method.
    pub fn carry(&self, mut place_mm: DVec3, time: f64) -> DVec3 {
        if self.wavenumber == DVec3::ZERO {
            return place_mm + self.amplitude_mm * time;
        }
        let steps = (f64::from(STEPS) * time.abs()).ceil();
        let h = if steps > 0.0 { time / steps } else { 0.0 };
        for _ in 0..steps as u64 {
            let a = self.at(place_mm);
            let b = self.at(place_mm + 0.5 * h * a);
            let c = self.at(place_mm + 0.5 * h * b);
            let d = self.at(place_mm + h * c);
            place_mm += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
        }
        place_mm
    }

    /// Displacement from one frame to the next of the particle that is at `place_mm` halfway between them, mm.
    pub fn displacement_mm(&self, place_mm: DVec3) -> DVec3 {
        self.carry(place_mm, 0.5) - self.carry(place_mm, -0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: [[f64; 2]; 3] = [[-2.0, 2.0], [-2.0, 2.0], [-5.0, 5.0]];

    /// A1 with a quarter of a cycle: 25 px in the middle, 25 cos(pi/4) px at the ends, and u alone.
    #[test]
    fn quarter_cycle_by_hand() {
        let flow = Flow::Wave { case: Case::A1, omega: 0.25, amplitude_px: 25.0 };
        let field = flow.in_volume(BOUNDS, 0.0055);
        assert!((field.at(DVec3::new(0.0, 1.0, 1.0)).x - 0.1375).abs() < 1e-12);
        assert!((field.at(DVec3::new(2.0, 0.0, 0.0)).x - 0.1375 * 0.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(field.at(DVec3::new(1.0, 0.0, 0.0)).z, 0.0);
    }

    /// dx/dt = a cos(k x) has the solution tan(k x / 2 + pi / 4) = tan(k x0 / 2 + pi / 4) exp(a k t).
    #[test]
    fn paths_follow_the_solution_on_paper() {
        let flow = Flow::Wave { case: Case::A1, omega: 2.0, amplitude_px: 25.0 };
        let field = flow.in_volume(BOUNDS, 0.0055);
        let (a, k, quarter) = (0.1375, std::f64::consts::TAU * 2.0 / 4.0, std::f64::consts::FRAC_PI_4);
        let x0 = 0.07f64;
        let exact = 2.0 / k * (((0.5 * k * x0 + quarter).tan() * (a * k).exp()).atan() - quarter);
        let carried = field.carry(DVec3::new(x0, 0.3, 0.1), 1.0).x;
        assert!((carried - exact).abs() < 1e-6 * 0.0055 * 25.0, "{carried} against {exact}");
        let back = field.carry(DVec3::new(carried, 0.3, 0.1), -1.0).x;
        assert!((back - x0).abs() < 1e-8);
    }

    #[test]
    fn uniform_is_uniform() {
        let field = Flow::Uniform { displacement_mm: [0.02, -0.013, 0.06] }.in_volume(BOUNDS, 0.0055);
        let d = field.displacement_mm(DVec3::new(0.3, 0.2, 0.1));
        assert!((d - DVec3::new(0.02, -0.013, 0.06)).length() < 1e-15);
    }
}
