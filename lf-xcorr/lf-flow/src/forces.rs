//! Gradients of the pressure, from the accelerations in one field or two.

use super::errors::Correlated;
use super::measured::stated_mm;
use glam::DVec3;
use lf_core::Field;
use lf_core::field::{Difference, NO_DATA};
use rayon::prelude::*;

/// Pascal a millimetre from kg/m^3 times mm/s^2.
const PASCAL: f64 = 1e-6;

/// Numbers that pressure needs beside the fields.
#[derive(Debug, Clone, Copy)]
pub struct PressureOptions {
    /// Density of the fluid, kg/m^3.
    pub density: f64,
    /// Time between the volumes of a field, s.
    pub dt_s: f64,
    /// Time from the first field to the second, s.
    pub interval_s: Option<f64>,
}

/// One field or two, with their uncertainties.
pub(super) struct Forces<'a> {
    fields: Vec<&'a Field>,
    /// Uncertainties of each field's u, v, w, mm; none if a component states none.
    sigma: Option<Vec<[Vec<f64>; 3]>>,
    options: &'a PressureOptions,
    errors: Correlated,
}

impl<'a> Forces<'a> {
    /// Forces of a field, and of a later one with its vectors at the same places.
    pub fn new(first: &'a Field, second: Option<&'a Field>, options: &'a PressureOptions) -> Self {
        let fields: Vec<&Field> = [Some(first), second].into_iter().flatten().collect();
        let of_field = |field: &&Field| -> Option<[Vec<f64>; 3]> {
            Some([stated_mm(field, 0)?, stated_mm(field, 1)?, stated_mm(field, 2)?])
        };
        let sigma = fields.iter().map(of_field).collect();
        Self { fields, sigma, options, errors: Correlated::new(&first.layout) }
    }

    /// Whether every field has data at a vector.
    pub fn has_data(&self, i: usize) -> bool {
        self.fields.iter().all(|field| field.flag[i] != NO_DATA)
    }

    /// Whether every component of every field states uncertainties.
    pub fn states_uncertainties(&self) -> bool {
        self.sigma.is_some()
    }

    /// Errors of each field by its own uncertainties, mm. None are drawn if a component states none.
    pub fn draw(&self, number: u64) -> Vec<Vec<DVec3>> {
        let draw = |(n, sigma): (usize, &[Vec<f64>; 3])| -> Vec<DVec3> {
            let number = 6 * number + 3 * n as u64;
            let drawn: [Vec<f64>; 3] = std::array::from_fn(|c| self.errors.draw(number + c as u64));
            (0..drawn[0].len()).map(|i| DVec3::from([0, 1, 2].map(|c| drawn[c][i] * sigma[c][i]))).collect()
        };
        self.sigma.iter().flatten().enumerate().map(draw).collect()
    }

    /// Gradient of the pressure at every vector, Pa/mm, with `errors` in mm added to each field. NaN where a slope is
    /// unknown.
    pub fn at(&self, errors: &[Vec<DVec3>]) -> Vec<DVec3> {
        let PressureOptions { density, dt_s, interval_s } = *self.options;
        let layout = &self.fields[0].layout;
        let moved = |n: usize, i: usize| {
            let displacement = self.fields[n].displacement_mm(i);
            errors.get(n).map_or(displacement, |errors| displacement + errors[i])
        };
        let both = self.fields.len() == 2;
        let middle = |i: usize| if both { 0.5 * (moved(0, i) + moved(1, i)) } else { moved(0, i) };
        let velocity: Vec<DVec3> = (0..self.fields[0].len()).into_par_iter().map(|i| middle(i) / dt_s).collect();
        let one = |i: usize| {
            let local = match interval_s.filter(|_| both) {
                Some(interval_s) => (moved(1, i) - moved(0, i)) / (dt_s * interval_s),
                None => DVec3::ZERO,
            };
            let carried = |axis: usize| match layout.difference(i, axis, |i| self.has_data(i)) {
                Some(Difference { low, high, distance_mm, .. }) => {
                    velocity[i][axis] * (1.0 / distance_mm) * (velocity[high] - velocity[low])
                }
                None => DVec3::NAN,
            };
            -PASCAL * density * (local + carried(0) + carried(1) + carried(2))
        };
        (0..velocity.len()).into_par_iter().map(one).collect()
    }
}
