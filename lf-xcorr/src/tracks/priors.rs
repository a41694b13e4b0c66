//! How much the flow bends and scatters, place by place, found in the pairs themselves.

use super::evidence::{Evidence, NUMBERS};
use super::fitter::Fitter;
use super::normal::MOST;
use super::window_fit::{Priors, TERMS, WindowFit};
use crate::vectors::Nodes;
use glam::DVec3;
use lf_core::statistics::robust;
use rayon::prelude::*;

/// Constant: rounds of better variances. Ten do for most flows; few particles in a vortex ring need twenty.
const ROUNDS: usize = 20;
/// Constant: standard deviation of the local means, in windows, and how far they reach.
const WIDTH: f64 = 0.7;
const REACH: usize = 2;
/// Constant: the mean of the whole field counts as this many windows, or three times as many pairs, beside local ones.
const WINDOWS: f64 = 3.0;

/// Priors on a grid of windows that do not overlap.
pub(crate) struct PriorField {
    nodes: Nodes,
    /// Natural logarithms of the numbers of [`Priors`].
    logs: Vec<[f64; NUMBERS]>,
}

impl PriorField {
    /// The priors under which the measured displacements are most likely.
    pub fn new(fitter: &Fitter) -> Self {
        let windows = (2.0 * fitter.half_mm / fitter.nodes.step).round().to_array();
        let nodes = fitter.nodes.every(windows.map(|steps| (steps as usize).max(1)));
        let start = first_guess(fitter);
        let mut priors = vec![start; nodes.count()];
        for _ in 0..ROUNDS {
            let of_window = |node: usize| {
                let samples = fitter.samples(nodes.place(node));
                let fit = WindowFit::new(&samples, &priors[node]);
                fit.map(|fit| Evidence::new(&samples, &fit, &priors[node])).unwrap_or_default()
            };
            let evidence: Vec<Evidence> = (0..nodes.count()).into_par_iter().map(of_window).collect();
            priors = local(&nodes, &evidence, &start, fitter.least_mm2());
        }
        let logs = priors.into_iter().map(|priors| priors.to_numbers().map(f64::ln)).collect();
        Self { nodes, logs }
    }

    /// The priors at a place: linear between windows in the logarithm.
    pub fn at(&self, place_mm: DVec3) -> Priors {
        let mut numbers = [0.0; NUMBERS];
        for (node, share) in self.nodes.shares(place_mm) {
            numbers.iter_mut().zip(&self.logs[node]).for_each(|(sum, log)| *sum += share * log);
        }
        Priors::of_numbers(&numbers.map(f64::exp))
    }
}

/// Before the first round: coefficients and scatter as large as the displacements differ at all.
fn first_guess(fitter: &Fitter) -> Priors {
    let component = |c: usize| robust(&fitter.rest_mm.iter().map(|rest| rest[c]).collect::<Vec<f64>>()).1;
    let spread = DVec3::from_array([0, 1, 2].map(component));
    let variance = (spread * spread).max(DVec3::splat(fitter.least_mm2()));
    let side = 2.0 * fitter.half_mm;
    let mut terms = [variance; TERMS];
    terms[0] = side * side;
    Priors { terms, scatter: 0.1 * variance, misfit: 1.0 }
}

/// The mean of the evidence about every window, beside that of the whole field.
fn local(nodes: &Nodes, evidence: &[Evidence], start: &Priors, least_mm2: f64) -> Vec<Priors> {
    let mut whole = Evidence::default();
    evidence.iter().for_each(|window| whole.add(window, 1.0));
    let start = start.to_numbers();
    let number = |sums: &Evidence, n: usize| {
        let worth = if n < MOST { WINDOWS } else { 3.0 * WINDOWS };
        let mean = if whole.below[n] > 0.0 { whole.above[n] / whole.below[n] } else { 0.0 };
        let value = (sums.above[n] + worth * mean) / (sums.below[n] + worth);
        match n {
            0..3 => start[n],
            n if n == NUMBERS - 1 => value.max(f64::MIN_POSITIVE),
            _ => value.max(least_mm2),
        }
    };
    let kernel = |steps: usize| (-0.5 * (steps as f64 / WIDTH).powi(2)).exp();
    let of_node = |node: usize| {
        let steps = nodes.steps(node);
        let near = |axis: usize| steps[axis].saturating_sub(REACH)..(steps[axis] + REACH + 1).min(nodes.shape[axis]);
        let mut sums = Evidence::default();
        for (k, j) in near(2).flat_map(|k| near(1).map(move |j| (k, j))) {
            for i in near(0) {
                let far = [i.abs_diff(steps[0]), j.abs_diff(steps[1]), k.abs_diff(steps[2])];
                sums.add(&evidence[nodes.index([i, j, k])], far.map(kernel).iter().product());
            }
        }
        Priors::of_numbers(&std::array::from_fn(|n| number(&sums, n)))
    };
    (0..nodes.count()).into_par_iter().map(of_node).collect()
}
