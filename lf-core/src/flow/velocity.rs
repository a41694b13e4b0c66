//! A velocity field, and the paths of particles through it.

use super::terms::Term;
use glam::DVec3;
use rayon::prelude::*;

/// A steady velocity field: the sum of its terms.
pub struct Velocity {
    terms: Vec<Term>,
    /// Integration steps in a unit of time; None if the velocity is the same everywhere.
    steps: Option<f64>,
}

/// Integration steps in a unit of time: at least this many, and this many times the largest rate. A step h is off by
/// (rate h)^5 / 120 of the displacement, here 3e-7; the error in the fastest of the paper's waves is below 1e-6 px.
const STEPS: f64 = 8.0;

/// Places along each axis at which the rate is sampled.
const PLACES: usize = 17;

impl Velocity {
    /// No motion.
    pub fn rest() -> Self {
        Self { terms: Vec::new(), steps: None }
    }

    /// The sum of `terms`; `is_uniform` says that none depends on the place.
    pub(super) fn new(terms: Vec<Term>, is_uniform: bool, bounds_mm: [[f64; 2]; 3]) -> Self {
        let velocity = Self { terms, steps: None };
        let steps = (!is_uniform).then(|| STEPS * velocity.rate(bounds_mm).max(1.0));
        Self { steps, ..velocity }
    }

    /// Largest change of velocity per distance in a volume, per unit of time, sampled on a regular grid of places. A
    /// finer distance finds waves shorter than the usual one.
    fn rate(&self, bounds_mm: [[f64; 2]; 3]) -> f64 {
        // The golden ratio in the finer distance and its places keeps a wave from having all places at its crests.
        let [usual, fine] =
            [(1e-4, 0.0), (1.618e-8, 0.3819660113)].map(|(share, off)| self.rate_over(share, off, bounds_mm));
        if fine > 2.0 * usual { fine } else { usual }
    }

    /// Like `rate`, but over a share of the volume's smallest extent, at places that are moved by `off` of their
    /// distance.
    fn rate_over(&self, share: f64, off: f64, bounds_mm: [[f64; 2]; 3]) -> f64 {
        let extent = DVec3::from(bounds_mm.map(|[low, high]| high - low));
        let (step, beside) = (share * extent.min_element(), off / (PLACES - 1) as f64 * extent);
        let change = |place: DVec3, half: DVec3| (self.at(place + half) - self.at(place - half)).length() / step;
        let pairs =
            places(bounds_mm, PLACES).flat_map(|place| DVec3::AXES.map(|axis| (place + beside, 0.5 * step * axis)));
        pairs.map(|(place, half)| change(place, half)).fold(0.0, f64::max)
    }

    /// Number of integration steps in a unit of time.
    pub fn steps(&self) -> f64 {
        self.steps.unwrap_or(1.0)
    }

    /// Velocity at a place, mm in a unit of time.
    pub fn at(&self, place_mm: DVec3) -> DVec3 {
        self.terms.iter().map(|term| term(place_mm)).sum()
    }

    /// Place of a particle after `time`, mm, by the classical fourth-order Runge-Kutta method. `time` may be negative.
    pub fn carry(&self, mut place_mm: DVec3, time: f64) -> DVec3 {
        let Some(steps) = self.steps else { return place_mm + self.at(place_mm) * time };
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

    /// Displacement during `interval` of the particle that passes `place_mm` in the middle of it, mm.
    pub fn displacement_mm(&self, place_mm: DVec3, interval: f64) -> DVec3 {
        self.carry(place_mm, 0.5 * interval) - self.carry(place_mm, -0.5 * interval)
    }

    /// [`Velocity::displacement_mm`] at many places, in parallel.
    pub fn displacements_mm(&self, places_mm: &[[f64; 3]], interval: f64) -> Vec<[f64; 3]> {
        let at = |place: &[f64; 3]| self.displacement_mm(DVec3::from(*place), interval).to_array();
        places_mm.par_iter().map(at).collect()
    }
}

/// A regular grid of `side` places along each axis, from bound to bound, x fastest.
pub fn places(bounds_mm: [[f64; 2]; 3], side: usize) -> impl Iterator<Item = DVec3> {
    let at = move |axis: usize, n: usize| {
        let [low, high] = bounds_mm[axis];
        low + (high - low) * n as f64 / (side - 1) as f64
    };
    (0..side.pow(3)).map(move |n| DVec3::new(at(0, n % side), at(1, n / side % side), at(2, n / side / side)))
}
