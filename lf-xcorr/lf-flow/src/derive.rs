//! Quantities that follow from a field's gradients, each with its uncertainty.
//!
//! A slope is the difference of two vectors, which share their errors as far as their windows overlap. The uncertainty
//! of a nonlinear quantity is the sum, in squares, of the changes that the uncertainty of each gradient makes.

use super::errors::Correlated;
use super::scalars::{divergence, lambda_2, q_criterion, shear, strain, swirl, vorticity};
use super::spread::rms;
use glam::{DMat3, DVec3};
use lf_core::Field;
use lf_core::field::{Array, Difference, NO_DATA};
use rayon::prelude::*;

/// Numbers at every vector: quantities, then their uncertainties.
const NUMBERS: usize = 15;

/// Quantities of a field.
#[derive(Debug, Clone)]
pub struct Derived {
    /// Quantities and, with names that begin with `s_`, their standard uncertainties.
    pub arrays: Vec<Array>,
    /// RMS divergence, and RMS of its uncertainty, over the vectors where they exist; in 1/s if the time between the
    /// volumes is known.
    pub divergence: [f64; 2],
    /// Vectors with all their gradients.
    pub places: usize,
}

/// A gradient and the standard uncertainties of its entries.
#[derive(Clone, Copy)]
struct Gradient {
    value: DMat3,
    sigma: DMat3,
}

/// The gradient of the displacement at a vector: slopes between its neighbours, or from one neighbour and itself at an
/// end and beside a gap. NaN along an axis without a neighbour.
fn gradient(field: &Field, errors: &Correlated, at: usize) -> Gradient {
    let has_data = |n: usize| field.flag[n] != NO_DATA;
    let mut found = Gradient { value: DMat3::NAN, sigma: DMat3::NAN };
    for axis in 0..3 {
        let Some(Difference { low, high, steps, distance_mm }) = field.layout.difference(at, axis, has_data) else {
            continue;
        };
        let factor = 1.0 / distance_mm;
        let [s, t] = [low, high].map(|n| field.uncertainty_mm(n));
        let variance = s * s + t * t - 2.0 * errors.between(axis, steps) * s * t;
        *found.value.col_mut(axis) = factor * (field.displacement_mm(high) - field.displacement_mm(low));
        *found.sigma.col_mut(axis) = factor * variance.max(DVec3::ZERO).powf(0.5);
    }
    found
}

/// The quantities of a field, by the time between its volumes if it is known.
pub fn derive(field: &Field) -> Derived {
    let errors = Correlated::new(&field.layout);
    let dt = field.layout.dt_s.unwrap_or(1.0);
    let at = |i: usize| {
        let found = gradient(field, &errors, i);
        let (gradient, sigma) = (found.value / dt, found.sigma / dt);
        let (velocity, s_velocity) = (field.displacement_mm(i) / dt, field.uncertainty_mm(i) / dt);
        let values = quantities(&gradient, velocity, field.flag[i] != NO_DATA);
        let mut squares = [0.0; NUMBERS];
        for axis in 0..3 {
            for c in 0..3 {
                let mut step = DMat3::ZERO;
                step.col_mut(axis)[c] = sigma.col(axis)[c];
                let [up, down] = [gradient + step, gradient - step].map(|moved| quantities(&moved, velocity, true));
                (0..NUMBERS).for_each(|n| squares[n] += (0.5 * (up[n] - down[n])).powi(2));
            }
        }
        squares[NUMBERS - 1] = (velocity * s_velocity).length_squared();
        (values, squares.map(f64::sqrt))
    };
    let all: Vec<([f64; NUMBERS], [f64; NUMBERS])> = (0..field.len()).into_par_iter().map(at).collect();
    let is_whole = |values: &[f64; NUMBERS]| values.iter().all(|value| value.is_finite());
    Derived {
        divergence: [rms(all.iter().map(|(values, _)| values[3])), rms(all.iter().map(|(_, sigma)| sigma[3]))],
        places: all.iter().filter(|(values, _)| is_whole(values)).count(),
        arrays: arrays(&all, field.layout.dt_s.is_some()),
    }
}

/// Vorticity (3), divergence, strain rates xx, yy, zz, xy, xz, yz, shear, Q, lambda-2, swirl, kinetic energy.
fn quantities(gradient: &DMat3, velocity: DVec3, has_data: bool) -> [f64; NUMBERS] {
    let (curl, s) = (vorticity(gradient), strain(gradient));
    let energy = if has_data { 0.5 * velocity.length_squared() } else { f64::NAN };
    let [x, y, z] = [s.x_axis, s.y_axis, s.z_axis];
    let criteria = [shear(gradient), q_criterion(gradient), lambda_2(gradient), swirl(gradient)];
    let [shear, q, lambda, swirl] = criteria.map(|value| if gradient.is_finite() { value } else { f64::NAN });
    [curl.x, curl.y, curl.z, divergence(gradient), x.x, y.y, z.z, x.y, x.z, y.z, shear, q, lambda, swirl, energy]
}

/// Names by unit: without the time between the volumes, and with it; first number and how many.
const NAMES: [(&str, &str, &str, &str, usize, usize); 9] = [
    ("vorticity", "s_vorticity", "vorticity_1_s", "s_vorticity_1_s", 0, 3),
    ("divergence", "s_divergence", "divergence_1_s", "s_divergence_1_s", 3, 1),
    ("strain_xx_yy_zz", "s_strain_xx_yy_zz", "strain_xx_yy_zz_1_s", "s_strain_xx_yy_zz_1_s", 4, 3),
    ("strain_xy_xz_yz", "s_strain_xy_xz_yz", "strain_xy_xz_yz_1_s", "s_strain_xy_xz_yz_1_s", 7, 3),
    ("shear", "s_shear", "shear_1_s", "s_shear_1_s", 10, 1),
    ("q_criterion", "s_q_criterion", "q_criterion_1_s2", "s_q_criterion_1_s2", 11, 1),
    ("lambda_2", "s_lambda_2", "lambda_2_1_s2", "s_lambda_2_1_s2", 12, 1),
    ("swirl", "s_swirl", "swirl_1_s", "s_swirl_1_s", 13, 1),
    ("energy_mm2", "s_energy_mm2", "energy_mm2_s2", "s_energy_mm2_s2", 14, 1),
];

fn arrays(all: &[([f64; NUMBERS], [f64; NUMBERS])], knows_time: bool) -> Vec<Array> {
    let list = |name: &'static str, number: &dyn Fn(usize, usize) -> f64, first: usize, components: usize| {
        let values = (0..all.len()).flat_map(|i| (first..first + components).map(move |n| (i, n)));
        Array { name, components, values: values.map(|(i, n)| number(i, n) as f32).collect() }
    };
    let both = |&(name, s_name, timed, s_timed, first, components): &(_, _, _, _, usize, usize)| {
        let (name, s_name) = if knows_time { (timed, s_timed) } else { (name, s_name) };
        let value = list(name, &|i, n| all[i].0[n], first, components);
        [value, list(s_name, &|i, n| all[i].1[n], first, components)]
    };
    NAMES.iter().flat_map(both).collect()
}
