//! Velocity fields, and the paths of particles through them.

use super::ring::Ring;
use super::sampled::Sampled;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// One of the fields that add up. Lengths mm, velocities mm in a unit of time.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Part {
    Uniform(DVec3),
    /// a cos(k . (r - centre) + phase): the real part of the paper's exponential about the middle of the volume.
    Wave {
        amplitude: DVec3,
        wavenumber: DVec3,
        centre: DVec3,
        phase: f64,
    },
    /// gradient (r - centre).
    Linear {
        gradient: DMat3,
        centre: DVec3,
    },
    Ring(Ring),
    Jet {
        centre: DVec3,
        axis: DVec3,
        radius: f64,
        shear_layer: f64,
        displacement: f64,
    },
    TaylorGreen {
        centre: DVec3,
        wavenumber: f64,
        amplitude: f64,
    },
    Abc {
        centre: DVec3,
        wavenumber: f64,
        amplitude: DVec3,
    },
    Sampled(Sampled),
}

impl Part {
    fn at(&self, place: DVec3) -> DVec3 {
        match self {
            Self::Uniform(velocity) => *velocity,
            Self::Wave { amplitude, wavenumber, centre, phase } => {
                *amplitude * (wavenumber.dot(place - *centre) + phase).cos()
            }
            Self::Linear { gradient, centre } => *gradient * (place - *centre),
            Self::Ring(ring) => ring.at(place),
            Self::Jet { centre, axis, radius, shear_layer, displacement } => {
                let from_axis = (place - *centre).reject_from_normalized(*axis).length();
                0.5 * displacement * (1.0 + ((radius - from_axis) / (2.0 * shear_layer)).tanh()) * *axis
            }
            Self::TaylorGreen { centre, wavenumber, amplitude } => {
                let DVec3 { x, y, z } = *wavenumber * (place - *centre);
                *amplitude * z.cos() * DVec3::new(x.sin() * y.cos(), -x.cos() * y.sin(), 0.0)
            }
            Self::Abc { centre, wavenumber, amplitude } => {
                let DVec3 { x, y, z } = *wavenumber * (place - *centre);
                let DVec3 { x: a, y: b, z: c } = *amplitude;
                DVec3::new(a * z.sin() + c * y.cos(), b * x.sin() + a * z.cos(), c * y.sin() + b * x.cos())
            }
            Self::Sampled(field) => field.at(place),
        }
    }
}

/// A steady velocity field: the sum of its parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Velocity {
    parts: Vec<Part>,
    /// Steps to a unit of time; none where the velocity is the same everywhere.
    steps: Option<f64>,
}

/// Steps to a unit of time at least, and times the greatest rate of strain: a step of h errs by (rate h)^5 / 120 of the
/// displacement, here 3e-7. The fastest of the paper's waves errs by less than 1e-6 px.
const STEPS: f64 = 8.0;

/// Places a side at which the rate is looked for.
const PLACES: usize = 17;

impl Velocity {
    /// No motion.
    pub fn rest() -> Self {
        Self { parts: Vec::new(), steps: None }
    }

    pub(super) fn new(parts: Vec<Part>, bounds_mm: [[f64; 2]; 3]) -> Self {
        let mut velocity = Self { parts, steps: None };
        if velocity.parts.iter().any(|part| !matches!(part, Part::Uniform(_))) {
            velocity.steps = Some(STEPS * velocity.rate(bounds_mm).max(1.0));
        }
        velocity
    }

    /// The greatest change of velocity over distance in a volume, each unit of time; looked for on a lattice of places.
    fn rate(&self, bounds_mm: [[f64; 2]; 3]) -> f64 {
        let extent = DVec3::from(bounds_mm.map(|[low, high]| high - low));
        let step = 1e-4 * extent.min_element();
        let mut rate = 0.0f64;
        for place in places(bounds_mm, PLACES) {
            for axis in DVec3::AXES {
                let change = self.at(place + 0.5 * step * axis) - self.at(place - 0.5 * step * axis);
                rate = rate.max(change.length() / step);
            }
        }
        rate
    }

    /// Steps that a unit of time is cut into.
    pub fn steps(&self) -> f64 {
        self.steps.unwrap_or(1.0)
    }

    /// Velocity at a place, mm a unit of time.
    pub fn at(&self, place_mm: DVec3) -> DVec3 {
        self.parts.iter().map(|part| part.at(place_mm)).sum()
    }

    /// Where a particle is after `time` (may be negative), by the classical fourth-order Runge-Kutta method.
    pub fn carry(&self, mut place_mm: DVec3, time: f64) -> DVec3 {
        let Some(steps) = self.steps else {
            return place_mm + self.at(place_mm) * time;
        };
        let steps = (steps * time.abs()).ceil();
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

    /// Displacement during `interval` of the particle that is at `place_mm` half way through it, mm.
    pub fn displacement_mm(&self, place_mm: DVec3, interval: f64) -> DVec3 {
        self.carry(place_mm, 0.5 * interval) - self.carry(place_mm, -0.5 * interval)
    }

    /// [`Velocity::displacement_mm`] at many places, side by side.
    pub fn displacements_mm(&self, places_mm: &[[f64; 3]], interval: f64) -> Vec<[f64; 3]> {
        let at = |place: &[f64; 3]| self.displacement_mm(DVec3::from(*place), interval).to_array();
        places_mm.par_iter().map(at).collect()
    }
}

/// A lattice of `side` places an axis from bound to bound.
pub fn places(bounds_mm: [[f64; 2]; 3], side: usize) -> impl Iterator<Item = DVec3> {
    let at = move |axis: usize, n: usize| {
        let [low, high] = bounds_mm[axis];
        low + (high - low) * n as f64 / (side - 1) as f64
    };
    (0..side.pow(3)).map(move |n| DVec3::new(at(0, n % side), at(1, n / side % side), at(2, n / side / side)))
}
