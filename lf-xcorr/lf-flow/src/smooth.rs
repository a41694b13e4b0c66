//! A field smoothed by penalised least squares.
//!
//! Equation: each component is the `u'` with the least `sum ((u' - u) / sigma)^2 + strength / s^2 * roughness(u')`,
//! with s the usual sigma (Garcia, Comput. Stat. Data Anal., 2010, with weights that are stated, and free ends).
//! Each component has a strength of its own: w is far less certain than u and v.

use super::bands::Bands;
use super::bend::window_means;
use super::conjugate::{Solution, solve};
use super::errors::Correlated;
use super::measured::Measured;
use super::planes::Planes;
use super::roughness::Roughness;
use super::spread::{Spread, box_mean, rms};
use super::strength;
use lf_core::statistics::median;
use lf_core::{Field, VectorGrid};
use rayon::prelude::*;

/// Constant: residual at which the solver stops, for the field and for scores, and its maximum number of steps.
const TOLERANCE: f64 = 1e-5;
const TOLERANCE_OF_SCORES: f64 = 1e-3;
const MAX_STEPS: usize = 3000;
/// Constant: number of error vectors drawn in all, and the minimum and maximum number of sets. Many vectors average out
/// what a smoothing leaves, so small fields need many sets.
const DRAWN: u64 = 200_000;
const DRAWS: (u64, u64) = (4, 24);
/// Constant: number of sets of errors that correct the estimate of the flow that is left out.
const BENT_DRAWS: u64 = 2;
/// Constant: reach of means of squares, in vectors.
const REACH: usize = 2;

/// A smooth field.
#[derive(Debug, Clone)]
pub struct Smoothed {
    /// The field. Its uncertainties are those of the errors that are left and of the flow that was smoothed away.
    pub field: Field,
    /// Strengths for u, v and w.
    pub strength: [f64; 3],
    /// RMS change of u, v and w, mm.
    pub change_mm: [f64; 3],
    /// RMS residual of u, v and w in their uncertainties, over the one that these explain: 1 if they are right.
    pub misfit: [f64; 3],
    /// Residual of the solver over its right side, if it stopped before its goal: the greatest of u, v, w.
    pub unsolved: Option<f64>,
}

/// Constant: the flow that a smoothing leaves out is seen in a weaker smoothing, of this share of its strength. That
/// one leaves out some of it too, so the variance of the flow is this many times the variance seen. Chosen for coverage
/// (`cargo bench -p lf-flow --bench flows -- choose`).
const SHOWN: f64 = 0.03;
const LOST: f64 = 1.5;
/// Constant: minimum share of a stated variance that counts as scatter, where the flow bends that much or the residual
/// is small.
const SCATTER: f64 = 0.25;
/// Constant: strength that smooths waves shorter than a window of four vectors.
const LIGHT: f64 = 0.5;

/// One component.
struct Component<'a> {
    layout: &'a VectorGrid,
    roughness: Roughness,
    planes: &'a Planes,
    /// 1 / variance over the usual one; 0 where nothing is measured.
    weights: Vec<f64>,
}

/// A smoothing of one strength.
struct Smoother<'a> {
    component: &'a Component<'a>,
    strength: f64,
    bands: Bands,
}

impl Smoother<'_> {
    fn apply(&self, values: &[f64], start: Vec<f64>, tolerance: f64) -> Solution {
        let Component { roughness, planes, weights, .. } = self.component;
        let right: Vec<f64> = values.iter().zip(weights).map(|(value, weight)| value * weight).collect();
        let apply = |x: &[f64], out: &mut [f64]| {
            out.iter_mut().zip(x.iter().zip(weights)).for_each(|(out, (x, weight))| *out = x * weight);
            roughness.add(self.strength, x, out);
        };
        let mut work = vec![0.0; values.len()];
        let precondition = |x: &[f64], out: &mut [f64]| planes.solve(&self.bands, x, out, &mut work);
        solve(apply, precondition, &right, start, tolerance, MAX_STEPS)
    }

    /// Square of the flow that windows and smoothing leave out, as a mean over neighbours. The weaker smoothing `shown`
    /// stands for the flow.
    fn lost(&self, values: &[f64], shown: &Smoother) -> Vec<f64> {
        let flow = shown.apply(values, values.to_vec(), TOLERANCE_OF_SCORES).values;
        let seen = window_means(self.component.layout, &flow);
        let again = self.apply(&seen, seen.clone(), TOLERANCE_OF_SCORES).values;
        self.component.difference(&flow, &again)
    }
}

impl<'a> Component<'a> {
    fn new(layout: &'a VectorGrid, planes: &'a Planes, sigma: &[f64], is_known: &[bool]) -> Self {
        let known = sigma.iter().zip(is_known).filter(|(_, known)| **known).map(|(sigma, _)| *sigma);
        let usual = median(&mut known.collect::<Vec<f64>>());
        let weight = |(sigma, known): (&f64, &bool)| if *known { (usual / sigma).powi(2) } else { 0.0 };
        let weights = sigma.iter().zip(is_known).map(weight).collect();
        Self { layout, roughness: Roughness::new(layout.shape), planes, weights }
    }

    /// Squares of differences, as means over neighbours.
    fn difference(&self, some: &[f64], others: &[f64]) -> Vec<f64> {
        let squares: Vec<f64> = some.iter().zip(others).map(|(some, other)| (some - other).powi(2)).collect();
        box_mean(&squares, self.layout.shape, [REACH; 3])
    }

    /// Uncertainties without the part for the flow that bends inside a window. Smoothing does not remove that part, so
    /// it must not count as noise. The bend is that of the values, lightly smoothed, less the bend of drawn errors. The
    /// residual of the light smoothing limits the rest, because a stated bend can be scatter itself.
    fn scatter(&self, values: &[f64], sigma: &[f64], number: u64) -> Vec<f64> {
        let smoother = self.smoother(LIGHT);
        let errors = Correlated::new(self.layout);
        let light = |values: &[f64]| smoother.apply(values, values.to_vec(), TOLERANCE_OF_SCORES).values;
        let bend = |values: &[f64]| {
            let smooth = light(values);
            let bend = self.difference(&smooth, &window_means(self.layout, &smooth));
            (bend, smooth)
        };
        let ((of_values, smooth), (of_errors, _)) =
            rayon::join(|| bend(values), || bend(&drawn(&errors, sigma, number)));
        let bends = of_values.iter().zip(&of_errors).map(|(of_values, of_errors)| (of_values - of_errors).max(0.0));
        let one = |(sigma, bend): (&f64, f64)| (sigma * sigma - bend).max(SCATTER * sigma * sigma).sqrt();
        let scatter: Vec<f64> = sigma.iter().zip(bends).map(one).collect();

        let noise = drawn(&errors, &scatter, number);
        let level = self.residual(values, &smooth) / self.residual(&noise, &light(&noise));
        let scale = level.clamp(SCATTER, 1.0).sqrt();
        scatter.iter().map(|sigma| scale * sigma).collect()
    }

    fn smoother(&self, strength: f64) -> Smoother<'_> {
        Smoother { component: self, strength, bands: self.planes.bands(&self.weights, strength) }
    }

    /// Mean product of measured values, in usual uncertainties.
    fn product(&self, some: &[f64], others: &[f64]) -> f64 {
        self.mean(some, others, |weight, one, other| weight * one * other)
    }

    /// Mean square residual of measured values, in usual uncertainties.
    fn residual(&self, values: &[f64], smooth: &[f64]) -> f64 {
        self.mean(values, smooth, |weight, value, smooth| weight * (value - smooth).powi(2))
    }

    fn mean(&self, some: &[f64], others: &[f64], term: impl Fn(f64, f64, f64) -> f64) -> f64 {
        let weighed = some.iter().zip(others).zip(&self.weights);
        let sum: f64 = weighed.map(|((one, other), weight)| term(*weight, *one, *other)).sum();
        sum / self.weights.iter().filter(|weight| **weight > 0.0).count() as f64
    }
}

/// A component after smoothing.
struct SmoothComponent {
    values: Vec<f64>,
    sigma: Vec<f64>,
    strength: f64,
    misfit: f64,
    unsolved: Option<f64>,
}

/// Smooths a field; `typed` strengths for u, v and w take the place of those with the least expected error.
pub fn smooth(field: &Field, measured: &Measured, typed: Option<[f64; 3]>) -> Smoothed {
    let planes = Planes::new(field.layout.shape);
    let one = |c: usize| {
        let component = |sigma: &[f64]| Component::new(&field.layout, &planes, sigma, &measured.is_known);
        let sigma = &measured.sigma[c];
        let scatter = component(sigma).scatter(&measured.values[c], sigma, 2000 + c as u64);
        component(&scatter).smooth(&measured.values[c], &scatter, 1000 + c as u64, typed.map(|typed| typed[c]))
    };
    let found: Vec<SmoothComponent> = (0..3usize).into_par_iter().map(one).collect();
    let [values, sigma] = [[0, 1, 2].map(|c| &found[c].values), [0, 1, 2].map(|c| &found[c].sigma)];
    let change = |c: usize| rms(values[c].iter().zip(&measured.values[c]).map(|(after, before)| after - before));
    Smoothed {
        field: measured.field(field, values, sigma),
        strength: [0, 1, 2].map(|c| found[c].strength),
        change_mm: [0, 1, 2].map(change),
        misfit: [0, 1, 2].map(|c| found[c].misfit),
        unsolved: found.iter().filter_map(|found| found.unsolved).reduce(f64::max),
    }
}

/// Errors of these standard deviations.
fn drawn(errors: &Correlated, sigma: &[f64], number: u64) -> Vec<f64> {
    errors.draw(number).iter().zip(sigma).map(|(error, sigma)| error * sigma).collect()
}

impl Component<'_> {
    /// Square of the flow that windows and smoothing leave out, less what drawn errors make of it: they too pass the
    /// weaker smoothing and not the stronger.
    fn left_out(&self, values: &[f64], sigma: &[f64], smoother: &Smoother, number: u64) -> Vec<f64> {
        let shown = self.smoother(SHOWN * smoother.strength);
        let errors = Correlated::new(self.layout);
        let of_errors = |n: u64| smoother.lost(&drawn(&errors, sigma, number + 10_000 * n), &shown);
        let many = || (1..=BENT_DRAWS).into_par_iter().map(of_errors).collect::<Vec<_>>();
        let (of_values, of_errors) = rayon::join(|| smoother.lost(values, &shown), many);
        let mean = |i: usize| of_errors.iter().map(|one| one[i]).sum::<f64>() / BENT_DRAWS as f64;
        of_values.iter().enumerate().map(|(i, of_values)| (of_values - mean(i)).max(0.0)).collect()
    }

    /// Smooths values of these standard uncertainties; `number` is the seed of the errors drawn.
    fn smooth(&self, values: &[f64], sigma: &[f64], number: u64, typed: Option<f64>) -> SmoothComponent {
        // Find the strength with the least expected error.
        let errors = Correlated::new(self.layout);
        let noise = drawn(&errors, sigma, number);
        let (mut of_values, mut of_noise) = (values.to_vec(), noise.clone());
        let mut score = |strength: f64| {
            let smoother = self.smoother(strength);
            let once = |values: &[f64], last: &mut Vec<f64>| {
                *last = smoother.apply(values, std::mem::take(last), TOLERANCE_OF_SCORES).values;
            };
            rayon::join(|| once(values, &mut of_values), || once(&noise, &mut of_noise));
            self.residual(values, &of_values) + 2.0 * self.product(&noise, &of_noise)
        };
        let strength = typed.unwrap_or_else(|| strength::best(&mut score));
        let smoother = self.smoother(strength);
        let Solution { values: smooth, unsolved, .. } = smoother.apply(values, of_values, TOLERANCE);

        // Estimate from drawn errors what is left of the uncertainty.
        let treat = |[drawn]: [Vec<f64>; 1]| {
            let left = smoother.apply(&drawn, drawn.clone(), TOLERANCE_OF_SCORES).values;
            let residual = self.residual(&drawn, &left);
            ([left], residual)
        };
        let draws = (DRAWN / values.len() as u64).clamp(DRAWS.0, DRAWS.1);
        let ([spread], expected) = Spread::new(&errors, [sigma], draws, treat);
        let shares = spread.shares(self.layout.shape, [REACH; 3]);
        let lost = self.left_out(values, sigma, &smoother, number);
        let left = |i: usize| (sigma[i] * sigma[i] * shares[i] + LOST * lost[i]).sqrt();
        let sigma = (0..sigma.len()).map(left).collect();
        let misfit = (self.residual(values, &smooth) / expected).sqrt();
        SmoothComponent { values: smooth, sigma, strength, misfit, unsolved }
    }
}
