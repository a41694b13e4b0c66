//! Methods that move all voxels by many pixels at once.
//!
//! SMART, and its ordered subsets (Byrne 1996; subsets as in Hudson & Larkin 1994), and MLEM (Shepp & Vardi 1982):
//!
//! ```text
//! E_j <- E_j exp(mu sum_i w_ij ln(I_i / p_i) / sum_i w_ij)        SMART, i over all pixels or one subset
//! E_j <- E_j (sum_i w_ij I_i / p_i / sum_i w_ij)^mu               MLEM
//!                                                                 p_i = sum_j w_ij E_j
//! ```
//!
//! A subset is every n-th image row, n the pixels under a lenslet: every voxel has rows in every subset, out of focus
//! as in focus, and each subset moves all strengths once, so a sweep moves them n times.

use crate::momentum::Momentum;
use crate::operator::{Operator, Plane, keep};
use crate::spent::Near;
use crate::{GREATEST_STRENGTH, Method, Problem, Solved, Sweep};
use lf_core::weights::RowSet;
use rayon::prelude::*;

/// Subsets of the default; fixed, since it was tuned with the relaxation.
const SUBSETS: usize = 14;

/// A voxel whose strength has fallen to this share of the strongest is spent: it is dropped. On the `core` scenes this
/// moves Q by less than 3e-4 (upwards).
const SPENT: f32 = 1e-4;

/// The same while the subsets' first sweeps still have the haze to clear: on the ready scenes `core` and `full` a third
/// of the time, and Q within 1e-3.
const SPENT_AT_FIRST: f32 = 3e-3;
const FIRST_SWEEPS: usize = 2;

/// The same where weights are remade at every use and each voxel costs most: a quarter of the time again, and Q within
/// 2e-3.
const SPENT_WHERE_REMADE: f32 = 1e-2;

/// Subsets in an order that has neighbours far apart: steps of 5 of 14.
fn order(subsets: usize) -> impl Iterator<Item = usize> {
    (0..subsets).map(move |n| n * 5 % subsets)
}

/// Squares of what the projection leaves and of the image, and pixels, over those the support reaches.
#[derive(Default)]
struct Misfit {
    off: f64,
    all: f64,
    pixels: usize,
}

impl Misfit {
    fn add(&mut self, other: &Self) {
        self.off += other.off;
        self.all += other.all;
        self.pixels += other.pixels;
    }

    fn value(&self) -> f64 {
        if self.all > 0.0 { (self.off / self.all).sqrt() } else { 0.0 }
    }
}

/// Turns the projection, in a subset's rows, into what is to be projected back.
fn compare(problem: &Problem, rows: RowSet, plane: &mut Plane) -> Misfit {
    let (stride, width) = (plane.stride, problem.image.ncols());
    let dark = problem.options.floor as f32;
    let ratios = problem.options.method == Method::Mlem;
    let lines = plane.values.par_chunks_mut(stride).enumerate().filter(|(row, _)| rows.holds(*row as u32));
    let parts: Vec<Misfit> = lines
        .map(|(row, projected)| {
            let mut misfit = Misfit::default();
            for (value, &pixel) in projected[..width].iter_mut().zip(problem.image.row(row)) {
                if pixel.is_nan() {
                    // Blind: as bright as is foretold.
                    *value = if ratios { 1.0 } else { 0.0 };
                } else if *value > 0.0 {
                    misfit.off += f64::from(pixel - *value).powi(2);
                    misfit.all += f64::from(pixel).powi(2);
                    misfit.pixels += 1;
                    let ratio = pixel.max(dark) / value.max(dark);
                    *value = if ratios { ratio } else { ratio.ln() };
                }
            }
            misfit
        })
        .collect();
    // One after the other: the sum is the same for any number of threads.
    let mut all = Misfit::default();
    parts.iter().for_each(|part| all.add(part));
    all
}

/// The voxels still held, and what is known of each.
struct State<'a> {
    problem: &'a Problem<'a>,
    operator: Operator<'a>,
    plane: Plane,
    active: Vec<u64>,
    strengths: Vec<f32>,
    /// A subset's share of each voxel's weights: one that sees less may not move the voxel as far.
    share: Vec<f32>,
    momentum: Momentum,
    /// What tells a part's spent voxels; none for a whole volume, whose strongest voxel does.
    near: Option<Near>,
    /// Of the sweep that is going on.
    misfit: Misfit,
    /// Weights of all voxels, and those touched in this sweep.
    weights: u64,
    touched: f64,
}

impl State<'_> {
    /// Moves all strengths by some image rows, and drops the voxels that are spent.
    fn step(&mut self, rows: RowSet, spent_share: f32) {
        let options = self.problem.options;
        let (relaxation, greatest) = (options.relaxation as f32, options.clamp.ln() as f32);
        let ratios = options.method == Method::Mlem;
        self.touched += 2.0 * self.weights as f64 / f64::from(rows.step);
        self.operator.project(rows, &self.strengths, &mut self.plane);
        self.misfit.add(&compare(self.problem, rows, &mut self.plane));
        let share = &self.share;
        self.operator.back_project(rows, &self.plane, &mut self.strengths, |voxel, strength, sum, weight| {
            if weight > 0.0 {
                let step = if ratios { (sum / weight).ln() } else { sum / weight.max(share[voxel]) };
                let factor = (relaxation * step).clamp(-greatest, greatest).exp();
                *strength = (*strength * factor).min(GREATEST_STRENGTH);
            }
        });
        // A part puts its spent voxels out at once, for when they are dropped depends on how many they are.
        let least = match &mut self.near {
            Some(near) => {
                near.put_out(&mut self.strengths, spent_share);
                0.0
            }
            None => spent_share * self.strengths.iter().fold(0f32, |peak, strength| peak.max(*strength)),
        };
        let spent = self.strengths.iter().filter(|strength| **strength <= least).count();
        // Dropping costs a look at each voxel.
        if spent * 20 > self.active.len() {
            let held: Vec<bool> = self.strengths.iter().map(|strength| *strength > least).collect();
            keep(&mut self.active, &held);
            keep(&mut self.share, &held);
            keep(&mut self.strengths, &held);
            self.momentum.retain(&held);
            self.near.iter_mut().for_each(|near| near.retain(&held));
            self.operator.retain(&held);
            self.weights = self.operator.weights();
        }
    }
}

pub(crate) fn solve(problem: &Problem, mut done: impl FnMut(&Sweep)) -> Solved {
    let Problem { footprint, options, .. } = *problem;
    let subsets = if options.method == Method::Subsets { SUBSETS } else { 1 };
    let (height, width) = problem.image.dim();
    let clears_haze = subsets > 1 && problem.start.is_none();
    let active = problem.indices.to_vec();
    let operator = Operator::new(footprint, &active, subsets, options.max_bytes);
    let mut share = operator.shares();
    let unseen = share.iter().filter(|share| **share <= 0.0).count();
    let mut strengths = problem.first_strengths();
    // Voxels that no pixel sees are put out.
    strengths.iter_mut().zip(&share).filter(|(_, share)| **share <= 0.0).for_each(|(strength, _)| *strength = 0.0);
    share.iter_mut().for_each(|share| *share /= subsets as f32);
    let mut state = State {
        problem,
        plane: Plane::new(width, height),
        momentum: Momentum::new(&strengths),
        near: options.part.map(|_| Near::new(footprint.grid(), problem.block_vox, &active)),
        misfit: Misfit::default(),
        weights: operator.weights(),
        touched: 0.0,
        operator,
        active,
        strengths,
        share,
    };

    let mut sweeps: Vec<Sweep> = Vec::new();
    for number in 1..=options.iterations {
        (state.misfit, state.touched) = (Misfit::default(), 0.0);
        for subset in order(subsets) {
            let spent_share = match clears_haze {
                // Of a part weights may be kept that of the whole are not.
                true if state.operator.is_remade() && options.part.is_none() => SPENT_WHERE_REMADE,
                true if number <= FIRST_SWEEPS => SPENT_AT_FIRST,
                _ => SPENT,
            };
            state.step(RowSet { first: subset as u32, step: subsets as u32 }, spent_share);
        }
        let misfit = state.misfit.value();
        let change = change(state.momentum.before(), &state.strengths);
        let sweep = Sweep { number, misfit, change, voxels: state.active.len(), weights: state.touched as u64 };
        done(&sweep);
        sweeps.push(sweep);
        let (pixels, light) = (state.misfit.pixels, state.misfit.all.sqrt());
        if number == options.iterations || problem.enough(&sweeps, pixels, light) {
            break;
        }
        if options.method == Method::Subsets {
            // Whether the misfit rises may differ from part to part.
            let misfit = if options.part.is_some() { 0.0 } else { misfit };
            state.momentum.carry(&mut state.strengths, misfit);
        } else {
            state.momentum.remember(&state.strengths);
        }
    }
    Solved { indices: state.active, strengths: state.strengths, sweeps, unseen }
}

/// Sum of the changes without sign over the sum.
pub(crate) fn change(before: &[f32], after: &[f32]) -> f64 {
    let (mut moved, mut all) = (0f64, 0f64);
    for (before, after) in before.iter().zip(after) {
        moved += f64::from(after - before).abs();
        all += f64::from(*after);
    }
    if all > 0.0 { moved / all } else { 0.0 }
}
