//! Methods that move all voxels by many pixels at once.
//!
//! SMART and its ordered subsets (Byrne 1996; subsets as in Hudson & Larkin 1994), and MLEM (Shepp & Vardi 1982):
//!
//! ```text
//! E_j <- E_j exp(mu sum_i w_ij ln(I_i / p_i) / sum_i w_ij)        SMART, i over all pixels or one subset
//! E_j <- E_j (sum_i w_ij I_i / p_i / sum_i w_ij)^mu               MLEM
//!                                                                 p_i = sum_j w_ij E_j
//! ```
//!
//! [`subsets`] divides the image rows. Each subset moves all strengths once, so n subsets move them n times a sweep.

use super::problem::{DARK, GREATEST_STRENGTH, Misfit, Problem, Solved, change};
use super::{dim_voxels::Neighbourhood, momentum::Momentum, subsets};
use crate::operator::{Operator, Plane, keep};
use crate::{options::Method, reconstruction::Sweep};
use lf_core::{Weights, weights::RowSet};
use rayon::prelude::*;

/// A voxel is dim, and dropped, when its strength falls to this share of the strongest. On the `core` scenes this
/// changes Q by less than 3e-4 (upwards).
const DIM: f32 = 1e-4;

/// The share during the first sweeps of `subsets`, in which nearly all voxels are still held. On the ready scenes
/// `core` and `full` this takes a third of the time and changes Q by less than 1e-3.
const DIM_AT_FIRST: f32 = 3e-3;
const FIRST_SWEEPS: usize = 2;

/// The share while weights are remade at every use, when each voxel costs most. It saves three quarters of the time
/// that is left, and changes Q by less than 2e-3.
const DIM_WHERE_REMADE: f32 = 1e-2;

/// Turns the projection, in a subset's rows, into what is projected back: ratios, or their logarithms.
fn compare(problem: &Problem, rows: RowSet, plane: &mut Plane) -> Misfit {
    let (stride, width) = (plane.stride, problem.image.ncols());
    let is_mlem = problem.options.method == Method::Mlem;
    let lines = plane.values.par_chunks_mut(stride).enumerate().filter(|(row, _)| rows.holds(*row as u32));
    let by_row: Vec<Misfit> = lines
        .map(|(row, projected)| {
            let mut misfit = Misfit::default();
            for (value, &pixel) in projected[..width].iter_mut().zip(problem.image.row(row)) {
                if pixel.is_nan() {
                    // A blind pixel is as bright as the projection says.
                    *value = if is_mlem { 1.0 } else { 0.0 };
                } else if *value > 0.0 {
                    misfit.add_pixel(pixel, *value);
                    let ratio = pixel.max(DARK) / value.max(DARK);
                    *value = if is_mlem { ratio } else { ratio.ln() };
                }
            }
            misfit
        })
        .collect();
    // One after the other, so that the sum is the same for any number of threads.
    let mut all = Misfit::default();
    by_row.iter().for_each(|row| all.add(row));
    all
}

/// The voxels still held.
struct State<'a> {
    problem: &'a Problem<'a>,
    operator: Operator<'a>,
    plane: Plane,
    indices: Vec<u64>,
    strengths: Vec<f32>,
    /// A subset's share of each voxel's weights. A subset that sees less of a voxel may not move it as far.
    share: Vec<f32>,
    momentum: Momentum,
    /// Finds a tile's dim voxels. In a whole volume the strongest voxel decides.
    neighbourhood: Option<Neighbourhood>,
    /// Misfit of the current sweep.
    misfit: Misfit,
    weights: u64,
    /// Weights touched in the current sweep.
    touched: f64,
    unseen: Vec<u64>,
}

impl<'a> State<'a> {
    fn new(problem: &'a Problem<'a>, subsets: usize) -> Self {
        let Problem { weights, options, indices, .. } = *problem;
        let (height, width) = problem.image.dim();
        let operator = Operator::new(weights, indices, subsets, options.max_bytes);
        let mut share = operator.shares();
        let is_unseen = |(index, share): (&u64, &f32)| (*share <= 0.0).then_some(*index);
        let unseen = indices.iter().zip(&share).filter_map(is_unseen).collect();
        let mut strengths = problem.first_strengths();
        // Extinguish the voxels that no pixel sees.
        strengths.iter_mut().zip(&share).filter(|(_, share)| **share <= 0.0).for_each(|(strength, _)| *strength = 0.0);
        share.iter_mut().for_each(|share| *share /= subsets as f32);
        let is_tile = options.tile.is_some();
        Self {
            problem,
            plane: Plane::new(width, height),
            momentum: Momentum::new(&strengths),
            neighbourhood: is_tile.then(|| Neighbourhood::new(weights.grid(), problem.block_vox, indices)),
            misfit: Misfit::default(),
            weights: operator.weights(),
            touched: 0.0,
            operator,
            indices: indices.to_vec(),
            strengths,
            share,
            unseen,
        }
    }

    /// Moves all strengths by some image rows.
    fn step(&mut self, rows: RowSet, dim_share: f32) {
        let options = self.problem.options;
        let (relaxation, greatest) = (options.relaxation as f32, options.clamp.ln() as f32);
        let is_mlem = options.method == Method::Mlem;
        // Project the strengths, and compare with the image.
        self.touched += 2.0 * self.weights as f64 / f64::from(rows.step);
        self.operator.project(rows, &self.strengths, &mut self.plane);
        self.misfit.add(&compare(self.problem, rows, &mut self.plane));
        // Project the ratios back, and move each strength.
        let share = &self.share;
        self.operator.back_project(rows, &self.plane, &mut self.strengths, |voxel, strength, sum, weight| {
            if weight > 0.0 {
                let step = if is_mlem { (sum / weight).ln() } else { sum / weight.max(share[voxel]) };
                let factor = (relaxation * step).clamp(-greatest, greatest).exp();
                *strength = (*strength * factor).min(GREATEST_STRENGTH);
            }
        });
        self.drop_dim(dim_share);
    }

    /// Drops the voxels below a share of the strongest, once they are a twentieth of those held.
    fn drop_dim(&mut self, dim_share: f32) {
        // A tile extinguishes its dim voxels at once, because when they are dropped depends on their number.
        let least = match &mut self.neighbourhood {
            Some(neighbourhood) => {
                neighbourhood.extinguish(&mut self.strengths, dim_share);
                0.0
            }
            None => dim_share * self.strengths.iter().fold(0f32, |peak, strength| peak.max(*strength)),
        };
        let dim = self.strengths.iter().filter(|strength| **strength <= least).count();
        // Dropping costs a look at each voxel.
        if dim * 20 > self.indices.len() {
            let held: Vec<bool> = self.strengths.iter().map(|strength| *strength > least).collect();
            keep(&mut self.indices, &held);
            keep(&mut self.share, &held);
            keep(&mut self.strengths, &held);
            keep(&mut self.momentum.before, &held);
            self.neighbourhood.iter_mut().for_each(|neighbourhood| neighbourhood.retain(&held));
            self.operator.retain(&held);
            self.weights = self.operator.weights();
        }
    }
}

/// The subsets of a method.
pub(crate) fn subsets(weights: &Weights, method: Method) -> usize {
    if method == Method::Subsets { subsets::number(weights.lenslet_rows_px()) } else { 1 }
}

pub(crate) fn solve(problem: &Problem, mut done: impl FnMut(&Sweep)) -> Solved {
    let options = problem.options;
    let (is_tile, has_subsets) = (options.tile.is_some(), options.method == Method::Subsets);
    let subsets = subsets(problem.weights, options.method);
    let starts_dense = has_subsets && problem.start.is_none();
    let mut state = State::new(problem, subsets);
    let mut sweeps: Vec<Sweep> = Vec::new();
    for number in 1..=options.iterations {
        (state.misfit, state.touched) = (Misfit::default(), 0.0);
        // Move the strengths by one subset of rows after another.
        for subset in subsets::order(subsets) {
            let dim_share = match starts_dense {
                // A tile may keep weights that the whole volume cannot, and must drop the same voxels.
                true if state.operator.is_remade() && !is_tile => DIM_WHERE_REMADE,
                true if number <= FIRST_SWEEPS => DIM_AT_FIRST,
                _ => DIM,
            };
            state.step(RowSet { first: subset as u32, step: subsets as u32 }, dim_share);
        }
        // Report the sweep, and end if it was the last.
        let misfit = state.misfit.value();
        let change = change(&state.momentum.before, &state.strengths);
        let sweep = Sweep { number, misfit, change, voxels: state.indices.len(), weights: state.touched as u64 };
        done(&sweep);
        sweeps.push(sweep);
        if number == options.iterations || problem.is_done(&sweeps, &state.misfit) {
            break;
        }
        // Keep weights that fit now, and extrapolate the strengths.
        state.operator.end_sweep();
        state.weights = state.operator.weights();
        if has_subsets {
            // Whether the misfit rises may differ from tile to tile, so a tile never resets its momentum.
            state.momentum.carry(&mut state.strengths, if is_tile { 0.0 } else { misfit });
        } else {
            state.momentum.before.copy_from_slice(&state.strengths);
        }
    }
    Solved { indices: state.indices, strengths: state.strengths, sweeps, unseen: state.unseen }
}
