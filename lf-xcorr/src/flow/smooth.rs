//! A field smoothed by penalised least squares.
//!
//! Equation: each component is the `u'` with the least `sum ((u' - u) / sigma)^2 + strength / s^2 * roughness(u')`,
//! with s the usual sigma (Garcia, Comput. Stat. Data Anal. 54, 2010, with weights that are stated, and free ends).
//! Each component has a strength of its own: w is far less certain than u and v.

use super::conjugate::solve;
use super::errors::Correlated;
use super::measured::Measured;
use super::roughness::Roughness;
use super::spread::{Spread, box_mean};
use super::strength;
use lf_core::Field;
use lf_core::statistics::median;
use rayon::prelude::*;

/// Constant: residual at which the solver stops, and its most steps.
const TOLERANCE: f64 = 1e-5;
const TOLERANCE_OF_SCORES: f64 = 1e-3;
const MOST: usize = 3000;
/// Constant: sets of errors that are drawn, and reach of means of squares, in vectors.
const DRAWS: u64 = 4;
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
    /// Vectors that were filled.
    pub filled: usize,
}

/// Constant: the flow that is smoothed away, as a variance, over the part that a second smoothing shows. The smooth
/// field has lost some of it already.
const LOST: f64 = 2.0;

/// One component.
struct Component<'a> {
    roughness: Roughness,
    diagonal: &'a [f64],
    /// 1 / variance over the usual one; 0 where nothing is measured.
    weights: Vec<f64>,
}

impl Component<'_> {
    fn solve(&self, strength: f64, values: &[f64], start: Vec<f64>, tolerance: f64) -> Vec<f64> {
        let right: Vec<f64> = values.iter().zip(&self.weights).map(|(value, weight)| value * weight).collect();
        let apply = |x: &[f64], out: &mut [f64]| {
            out.iter_mut().zip(x.iter().zip(&self.weights)).for_each(|(out, (x, weight))| *out = x * weight);
            self.roughness.add(strength, x, out);
        };
        let precondition = |x: &[f64], out: &mut [f64]| {
            let scale = self.diagonal.iter().zip(&self.weights).map(|(diagonal, weight)| weight + strength * diagonal);
            out.iter_mut().zip(x.iter().zip(scale)).for_each(|(out, (x, scale))| *out = x / scale);
        };
        solve(apply, precondition, &right, start, tolerance, MOST).values
    }

    /// Mean product of errors before and after the smoothing, as [`Component::residual`] counts.
    fn product(&self, before: &[f64], after: &[f64]) -> f64 {
        let weighed = before.iter().zip(after).zip(&self.weights);
        let sum: f64 = weighed.map(|((before, after), weight)| weight * before * after).sum();
        sum / self.weights.iter().filter(|weight| **weight > 0.0).count() as f64
    }

    /// The square of the flow that the smoothing takes away, a mean over neighbours: the smooth field stands for the
    /// flow.
    fn lost(&self, smooth: &[f64], strength: f64, shape: [usize; 3]) -> Vec<f64> {
        let again = self.solve(strength, smooth, smooth.to_vec(), TOLERANCE_OF_SCORES);
        let squares: Vec<f64> = smooth.iter().zip(&again).map(|(smooth, again)| (smooth - again).powi(2)).collect();
        box_mean(&squares, shape, [REACH; 3])
    }

    /// Mean square residual of measured values, in usual uncertainties.
    fn residual(&self, values: &[f64], smooth: &[f64]) -> f64 {
        let weighed = values.iter().zip(smooth).zip(&self.weights);
        let sum: f64 = weighed.map(|((value, smooth), weight)| weight * (value - smooth).powi(2)).sum();
        sum / self.weights.iter().filter(|weight| **weight > 0.0).count() as f64
    }
}

/// One component smoothed.
struct Found {
    values: Vec<f64>,
    sigma: Vec<f64>,
    strength: f64,
    misfit: f64,
}

/// Smooths a field; `typed` strengths for u, v and w take the place of those with the least expected error.
pub fn smooth(field: &Field, measured: &Measured, typed: Option<[f64; 3]>) -> Smoothed {
    let roughness = Roughness::new(field.layout.shape);
    let diagonal = roughness.diagonal();
    let one = |c: usize| {
        let known = measured.sigma[c].iter().zip(&measured.is_known).filter(|(_, known)| **known);
        let usual = median(&mut known.map(|(sigma, _)| *sigma).collect::<Vec<f64>>());
        let weight = |(sigma, known): (&f64, &bool)| if *known { (usual / sigma).powi(2) } else { 0.0 };
        let weights = measured.sigma[c].iter().zip(&measured.is_known).map(weight).collect();
        let component = Component { roughness, diagonal: &diagonal, weights };
        component.smooth(field, measured, c, typed.map(|typed| typed[c]))
    };
    let found: Vec<Found> = (0..3usize).into_par_iter().map(one).collect();
    let change = |c: usize| {
        let changes = found[c].values.iter().zip(&measured.values[c]).map(|(after, before)| (after - before).powi(2));
        (changes.sum::<f64>() / found[c].values.len() as f64).sqrt()
    };
    let [values, sigma] = [|found: &Found| found.values.clone(), |found: &Found| found.sigma.clone()]
        .map(|of| [0, 1, 2].map(|c| of(&found[c])));
    Smoothed {
        field: measured.field(field, &values, &sigma),
        strength: [0, 1, 2].map(|c| found[c].strength),
        change_mm: [0, 1, 2].map(change),
        misfit: [0, 1, 2].map(|c| found[c].misfit),
        filled: measured.filled(),
    }
}

impl Component<'_> {
    fn smooth(&self, field: &Field, measured: &Measured, c: usize, typed: Option<f64>) -> Found {
        let (values, sigma) = (&measured.values[c], &measured.sigma[c]);
        let errors = Correlated::new(&field.layout);
        let noise: Vec<f64> =
            errors.draw(1000 + c as u64).iter().zip(sigma).map(|(error, sigma)| error * sigma).collect();
        let (mut of_values, mut of_noise) = (values.clone(), noise.clone());
        let mut score = |strength: f64| {
            of_values = self.solve(strength, values, std::mem::take(&mut of_values), TOLERANCE_OF_SCORES);
            of_noise = self.solve(strength, &noise, std::mem::take(&mut of_noise), TOLERANCE_OF_SCORES);
            self.residual(values, &of_values) + 2.0 * self.product(&noise, &of_noise)
        };
        let strength = typed.unwrap_or_else(|| strength::best(&mut score));
        let smooth = self.solve(strength, values, of_values, TOLERANCE);

        let treat = |[drawn]: [Vec<f64>; 1]| {
            let left = self.solve(strength, &drawn, drawn.clone(), TOLERANCE_OF_SCORES);
            let residual = self.residual(&drawn, &left);
            ([left], residual)
        };
        let ([spread], expected) = Spread::new(&errors, [sigma], DRAWS, treat);
        let lost = self.lost(&smooth, strength, field.layout.shape);
        // Errors that are left are smoothed away a second time too; they are no flow.
        let of_errors =
            self.lost(&self.solve(strength, &noise, of_noise, TOLERANCE_OF_SCORES), strength, field.layout.shape);
        let shares = spread.shares(field.layout.shape, [REACH; 3]);
        let lost = lost.iter().zip(&of_errors).map(|(lost, of_errors)| LOST * (lost - of_errors).max(0.0));
        let left = sigma.iter().zip(shares.iter().zip(lost));
        let misfit = (self.residual(values, &smooth) / expected).sqrt();
        let sigma = left.map(|(sigma, (share, lost))| (sigma * sigma * share + lost).sqrt()).collect();
        Found { values: smooth, sigma, strength, misfit }
    }
}
