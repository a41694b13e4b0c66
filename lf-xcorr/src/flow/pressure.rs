//! Pressure from the acceleration of the fluid.
//!
//! Equation: `grad p = -density * a` without friction, with the acceleration of a particle of fluid
//! `a = du/dt + (u . grad) u`. The pressure is the one whose differences between neighbours are nearest to the mean of
//! their gradients (least squares; its normal equations are a Poisson equation with `a` at the walls). It is known up
//! to a constant: its mean is 0.

use super::conjugate::solve;
use super::derive::gradient;
use super::errors::Correlated;
use glam::{DMat3, DVec3};
use lf_core::field::{Array, NO_DATA};
use lf_core::{Field, Refusal};
use rayon::prelude::*;

/// Constant: residual at which the solver stops, for the pressure and for drawn errors, and its most steps.
const TOLERANCE: f64 = 1e-7;
const TOLERANCE_OF_ERRORS: f64 = 1e-3;
const MOST: usize = 5000;
/// Constant: sets of errors that are drawn for the uncertainty.
const DRAWS: u64 = 16;
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

/// Pressure at every vector.
#[derive(Debug, Clone)]
pub struct Pressure {
    /// Pressure and its standard uncertainty, Pa. NaN where there is no data.
    pub arrays: Vec<Array>,
    /// RMS pressure, and RMS of its uncertainty, Pa.
    pub rms_pa: [f64; 2],
    /// RMS of the part of the pressure's gradient that no pressure has, over the RMS of the gradient.
    pub misfit: f64,
}

/// The pressure of a steady flow from one field, or in the middle between two. Refuses a second field with its vectors
/// at other places.
pub fn pressure(first: &Field, second: Option<&Field>, options: &PressureOptions) -> Result<Pressure, Refusal> {
    if let Some(second) = second {
        let (a, b) = (&first.layout, &second.layout);
        let is_same = a.shape == b.shape && a.spacing_mm == b.spacing_mm && a.origin_mm == b.origin_mm;
        Refusal::unless(is_same, || "vectors at other places", "wanted those of the first field")?;
    }
    let middle = second.map_or_else(|| first.clone(), |second| mean(first, second));
    let errors = Correlated::new(&first.layout);
    let forces = Forces { first, second, middle: &middle, options, errors };
    let graph = Graph::new(&middle);
    let force = forces.at(&vec![DVec3::ZERO; first.len()], &vec![DVec3::ZERO; first.len()]);
    let (values, misfit) = graph.pressure(&force, TOLERANCE);

    let drawn = |n: u64| {
        let [one, other] = [0, 1].map(|k| forces.draw(first, 6 * n + 3 * k));
        let force = forces.at(&one, if second.is_some() { &other } else { &one });
        graph.pressure(&force, TOLERANCE_OF_ERRORS).0
    };
    let all: Vec<Vec<f64>> = (0..DRAWS).into_par_iter().map(drawn).collect();
    let sigma = |i: usize| (all.iter().map(|drawn| (drawn[i] - values[i]).powi(2)).sum::<f64>() / DRAWS as f64).sqrt();
    let sigma: Vec<f64> = (0..values.len()).map(sigma).collect();
    let has_data = |i: usize| middle.flag[i] != NO_DATA;
    let rms = |values: &[f64]| {
        let known = values.iter().enumerate().filter(|(i, value)| has_data(*i) && value.is_finite());
        let (sum, count) = known.fold((0.0, 0.0), |(sum, n), (_, value)| (sum + value * value, n + 1.0));
        (sum / count).sqrt()
    };
    let stored = |values: &[f64]| -> Vec<f32> {
        values.iter().enumerate().map(|(i, value)| if has_data(i) { *value as f32 } else { f32::NAN }).collect()
    };
    Ok(Pressure {
        arrays: vec![Array::scalars("pressure_pa", &stored(&values)), Array::scalars("s_pressure_pa", &stored(&sigma))],
        rms_pa: [rms(&values), rms(&sigma)],
        misfit,
    })
}

/// The field in the middle between two. It has data where both have.
fn mean(first: &Field, second: &Field) -> Field {
    let mut middle = first.clone();
    let half = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect::<Vec<f32>>();
    let root = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| 0.5 * a.hypot(*b)).collect::<Vec<f32>>();
    middle.u = half(&first.u, &second.u);
    middle.v = half(&first.v, &second.v);
    middle.w = half(&first.w, &second.w);
    middle.su = root(&first.su, &second.su);
    middle.sv = root(&first.sv, &second.sv);
    middle.sw = root(&first.sw, &second.sw);
    middle.flag = first.flag.iter().zip(&second.flag).map(|(a, b)| a.max(*b)).collect();
    middle
}

/// The gradients of pressure that fields give.
struct Forces<'a> {
    first: &'a Field,
    second: Option<&'a Field>,
    middle: &'a Field,
    options: &'a PressureOptions,
    errors: Correlated,
}

impl Forces<'_> {
    /// Errors of a field, mm, by its uncertainties. Vectors without one have none.
    fn draw(&self, field: &Field, number: u64) -> Vec<DVec3> {
        let drawn: [Vec<f64>; 3] = std::array::from_fn(|c| self.errors.draw(number + c as u64));
        let at = |i: usize| {
            let sigma = field.uncertainty_mm(i).to_array().map(|sigma| if sigma.is_finite() { sigma } else { 0.0 });
            DVec3::from_array(sigma) * DVec3::new(drawn[0][i], drawn[1][i], drawn[2][i])
        };
        (0..field.len()).map(at).collect()
    }

    /// Gradient of the pressure at every vector, Pa/mm, if errors are added to the fields.
    fn at(&self, to_first: &[DVec3], to_second: &[DVec3]) -> Vec<DVec3> {
        let PressureOptions { density, dt_s, interval_s } = *self.options;
        let mut middle = self.middle.clone();
        let shift = |i: usize| match self.second {
            Some(_) => 0.5 * (to_first[i] + to_second[i]),
            None => to_first[i],
        };
        for i in 0..middle.len() {
            [middle.u[i], middle.v[i], middle.w[i]] = (self.middle.displacement_mm(i) + shift(i)).as_vec3().to_array();
        }
        let one = |i: usize| {
            let velocity = middle.displacement_mm(i) / dt_s;
            let gradient: DMat3 = gradient(&middle, &self.errors, i).value / dt_s;
            let local = match (self.second, interval_s) {
                (Some(second), Some(interval_s)) => {
                    let change = second.displacement_mm(i) + to_second[i] - self.first.displacement_mm(i) - to_first[i];
                    change / (dt_s * interval_s)
                }
                _ => DVec3::ZERO,
            };
            -PASCAL * density * (local + gradient * velocity)
        };
        (0..middle.len()).into_par_iter().map(one).collect()
    }
}

/// Pairs of neighbours that both have data.
struct Graph<'a> {
    field: &'a Field,
    /// Sum of 1 / distance^2 over the neighbours of a vector.
    diagonal: Vec<f64>,
}

impl<'a> Graph<'a> {
    fn new(field: &'a Field) -> Self {
        let mut diagonal = vec![0.0; field.len()];
        let mut graph = Self { field, diagonal: Vec::new() };
        graph.pairs(|i, j, axis| {
            let weight = field.layout.spacing_mm[axis].powi(-2);
            diagonal[i] += weight;
            diagonal[j] += weight;
        });
        graph.diagonal = diagonal;
        graph
    }

    /// Calls `pair(i, j, axis)` for every vector and its next neighbour along an axis, if both have data.
    fn pairs(&self, mut pair: impl FnMut(usize, usize, usize)) {
        let shape = self.field.layout.shape;
        let has_data = |i: usize| self.field.flag[i] != NO_DATA;
        for axis in 0..3 {
            let stride: usize = shape[..axis].iter().product();
            for i in 0..self.field.len() {
                if i / stride % shape[axis] + 1 < shape[axis] && has_data(i) && has_data(i + stride) {
                    pair(i, i + stride, axis);
                }
            }
        }
    }

    /// The pressure of gradients, and the share of these that it does not explain.
    fn pressure(&self, force: &[DVec3], tolerance: f64) -> (Vec<f64>, f64) {
        let spacing = self.field.layout.spacing_mm;
        let finite = |force: DVec3, axis: usize| if force[axis].is_finite() { force[axis] } else { 0.0 };
        let between = |i: usize, j: usize, axis: usize| 0.5 * (finite(force[i], axis) + finite(force[j], axis));
        let mut right = vec![0.0; force.len()];
        self.pairs(|i, j, axis| {
            let step = between(i, j, axis) / spacing[axis];
            right[i] -= step;
            right[j] += step;
        });
        let apply = |p: &[f64], out: &mut [f64]| {
            out.fill(0.0);
            self.pairs(|i, j, axis| {
                let slope = (p[j] - p[i]) / spacing[axis].powi(2);
                out[j] += slope;
                out[i] -= slope;
            });
        };
        let precondition = |rest: &[f64], out: &mut [f64]| {
            let shares = rest.iter().zip(&self.diagonal).map(|(rest, d)| if *d > 0.0 { rest / d } else { 0.0 });
            out.iter_mut().zip(shares).for_each(|(out, share)| *out = share);
        };
        let found = solve(apply, precondition, &right, vec![0.0; force.len()], tolerance, MOST);
        let (mut values, [mut rest, mut all]) = (found.values, [0.0; 2]);
        self.pairs(|i, j, axis| {
            let wanted = between(i, j, axis);
            rest += ((values[j] - values[i]) / spacing[axis] - wanted).powi(2);
            all += wanted.powi(2);
        });
        let known: Vec<usize> = (0..values.len()).filter(|i| self.field.flag[*i] != NO_DATA).collect();
        let mean = known.iter().map(|i| values[*i]).sum::<f64>() / known.len().max(1) as f64;
        values.iter_mut().for_each(|value| *value -= mean);
        (values, (rest / all).sqrt())
    }
}
