//! How much the flow bends and scatters, place by place, found in the pairs themselves.

use super::evidence::{Evidence, NUMBERS};
use super::fitter::Fitter;
use super::log_field::LogField;
use super::window_fit::{Priors, TERMS, UNKNOWNS, WindowFit};
use crate::vectors::Nodes;
use glam::DVec3;
use lf_core::statistics::robust;
use rayon::prelude::*;

/// Constant: rounds of better variances. Ten are enough for ordinary flows; few particles in a vortex ring need twenty.
const ROUNDS: usize = 20;
/// Constant: standard deviation of the local means, in windows, and how far they reach.
const WIDTH: f64 = 0.7;
const REACH: usize = 2;
/// Constant: weight of the whole field's mean beside the local ones, in windows; in pairs it is three times as much.
const WINDOWS: f64 = 3.0;

/// Priors on a grid of windows that do not overlap.
pub(crate) struct PriorField(LogField<NUMBERS>);

impl PriorField {
    /// The priors under which the measured displacements are most likely.
    pub fn new(fitter: &Fitter) -> Self {
        let nodes = fitter.nodes.apart(2.0 * fitter.half_mm);
        let start = first_guess(fitter);
        let mut priors = vec![start; nodes.count()];
        for _ in 0..ROUNDS {
            let of_window = |node: usize| {
                let samples = fitter.samples(nodes.place(node));
                let fit = WindowFit::new(&samples, &priors[node]);
                fit.map(|fit| Evidence::new(&samples, &fit, &priors[node])).unwrap_or_default()
            };
            let evidence: Vec<Evidence> = (0..nodes.count()).into_par_iter().map(of_window).collect();
            priors = local(&nodes, &evidence, &start, fitter.minimum_mm2());
        }
        Self(LogField { nodes, logs: priors.into_iter().map(|priors| priors.to_numbers().map(f64::ln)).collect() })
    }

    /// The priors at a place.
    pub fn at(&self, place_mm: DVec3) -> Priors {
        Priors::of_numbers(&self.0.at(place_mm))
    }
}

/// Before the first round: coefficients and scatter as large as the spread of the displacements.
fn first_guess(fitter: &Fitter) -> Priors {
    let component = |c: usize| robust(&fitter.rest_mm.iter().map(|rest| rest[c]).collect::<Vec<f64>>()).1;
    let spread = DVec3::from_array([0, 1, 2].map(component));
    let variance = (spread * spread).max(DVec3::splat(fitter.minimum_mm2()));
    let side = 2.0 * fitter.half_mm;
    let mut terms = [variance; TERMS];
    terms[0] = side * side;
    Priors { terms, scatter: 0.1 * variance, misfit: 1.0 }
}

/// The mean of the evidence around every window, combined with that of the whole field.
fn local(nodes: &Nodes, evidence: &[Evidence], start: &Priors, minimum_mm2: f64) -> Vec<Priors> {
    let mut whole = Evidence::default();
    evidence.iter().for_each(|window| whole.add(window, 1.0));
    let start = start.to_numbers();
    let number = |sums: &Evidence, n: usize| {
        let weight = if n < UNKNOWNS { WINDOWS } else { 3.0 * WINDOWS };
        let mean = if whole.below[n] > 0.0 { whole.above[n] / whole.below[n] } else { 0.0 };
        let value = (sums.above[n] + weight * mean) / (sums.below[n] + weight);
        match n {
            0..3 => start[n],
            n if n == NUMBERS - 1 => value.max(f64::MIN_POSITIVE),
            _ => value.max(minimum_mm2),
        }
    };
    let kernel = |steps: usize| (-0.5 * (steps as f64 / WIDTH).powi(2)).exp();
    let of_node = |node: usize| {
        let steps = nodes.steps(node);
        let mut sums = Evidence::default();
        for other in nodes.around(node, REACH) {
            let far = [0, 1, 2].map(|axis| other[axis].abs_diff(steps[axis]));
            sums.add(&evidence[nodes.index(other)], far.map(kernel).iter().product());
        }
        Priors::of_numbers(&std::array::from_fn(|n| number(&sums, n)))
    };
    (0..nodes.count()).into_par_iter().map(of_node).collect()
}
