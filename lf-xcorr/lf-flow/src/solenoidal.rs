//! The divergence-free field that is nearest to a measured one, by its uncertainties.
//!
//! Equation: the field u' without divergence, `D u' = 0`, whose `sum ((u' - u) / sigma)^2` over all vectors and
//! components is least. With the variances S that is `u' = u - S D' lambda` and `D S D' lambda = D u` (after de Silva,
//! Philip & Marusic, Exp. Fluids, 2013, with the weights of Azijli & Dwight, Exp. Fluids, 2015). w is by far the
//! least certain and changes most: continuity determines it from u and v.
//!
//! D is the divergence of `slopes.rs`, at every vector. The normal matrix is applied, never stored.

use super::bands::Bands;
use super::conjugate::{Solution, dot, solve};
use super::errors::Correlated;
use super::lines::lines;
use super::measured::Measured;
use super::slopes::Slopes;
use super::spread::{Spread, rms};
use lf_core::Field;

/// Constant: residual of the solver for the field, the share of the divergence that is left.
const TOLERANCE: f64 = 1e-7;
/// Constant: residual of the solver for drawn errors, whose squares matter to a per cent.
const TOLERANCE_OF_ERRORS: f64 = 1e-3;
/// Constant: maximum number of steps of the solver. A full field takes about a hundred.
const MAX_STEPS: usize = 5000;
/// Constant: number of sets of errors drawn, and reach of the mean of their squares, in vectors. The share of the
/// variance that is left is then known to about 10 %.
const DRAWS: u64 = 24;
const REACH: usize = 1;

/// Constant: below this misfit the errors are smoother than those of windows, and so make less divergence. They need
/// not be smaller.
pub const SMOOTHED: f64 = 0.75;

/// A divergence-free field.
#[derive(Debug, Clone)]
pub struct Solenoidal {
    /// The field. Its uncertainties are what is left of the stated ones.
    pub field: Field,
    /// RMS divergence before and after, without unit.
    pub divergence: [f64; 2],
    /// RMS change of u, v and w, mm.
    pub change_mm: [f64; 3],
    /// The field's misfit to continuity over the one that its uncertainties explain: 1 if they are right. Less than
    /// [`SMOOTHED`] if the field was smoothed before.
    pub misfit: f64,
    /// Share of the variance of u, v and w that is left: means over the field.
    pub left: [f64; 3],
    /// Steps that the solver took.
    pub steps: usize,
    /// Residual of the solver over its right side, if it stopped before its goal.
    pub unsolved: Option<f64>,
}

/// The problem: differences, variances, and the factors of their lines.
struct Projection {
    slopes: Slopes,
    variances: [Vec<f64>; 3],
    lines: Bands,
    /// The axis whose component is the least certain.
    axis: usize,
}

impl Projection {
    fn new(field: &Field, measured: &Measured) -> Self {
        let slopes = Slopes::new(&field.layout);
        let variances = [0, 1, 2].map(|c| measured.sigma[c].iter().map(|sigma| sigma * sigma).collect::<Vec<f64>>());
        let weight = |axis: usize| variances[axis].iter().sum::<f64>() / field.layout.spacing_mm[axis].powi(2);
        let axis = (0..3).max_by(|a, b| weight(*a).total_cmp(&weight(*b))).unwrap_or(2);
        let lines = lines(&slopes, &variances, axis);
        Self { slopes, variances, lines, axis }
    }

    /// `S D' lambda`, component by component.
    fn correction(&self, lambda: &[f64], out: &mut [Vec<f64>; 3]) {
        for (axis, out) in out.iter_mut().enumerate() {
            out.fill(0.0);
            self.slopes.add_transposed(axis, lambda, out);
            out.iter_mut().zip(&self.variances[axis]).for_each(|(out, variance)| *out *= variance);
        }
    }

    /// The components without their divergence, the solver's solution, and `sum ((u' - u) / sigma)^2`.
    fn project(&self, mut components: [Vec<f64>; 3], tolerance: f64) -> ([Vec<f64>; 3], Solution, f64) {
        let count = components[0].len();
        let mut right = vec![0.0; count];
        self.slopes.divergence(&components, &mut right);
        let mut correction: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; count]);
        let apply = |lambda: &[f64], out: &mut [f64]| {
            self.correction(lambda, &mut correction);
            self.slopes.divergence(&correction, out);
        };
        let precondition = |rest: &[f64], out: &mut [f64]| {
            out.copy_from_slice(rest);
            self.lines.solve(out);
        };
        let solution = solve(apply, precondition, &right, vec![0.0; count], tolerance, MAX_STEPS);
        let misfit = dot(&solution.values, &right);
        self.correction(&solution.values, &mut correction);
        for (values, correction) in components.iter_mut().zip(&correction) {
            values.iter_mut().zip(correction).for_each(|(value, correction)| *value -= correction);
        }
        (components, solution, misfit)
    }

    fn rms_divergence(&self, components: &[Vec<f64>; 3]) -> f64 {
        let mut divergence = vec![0.0; components[0].len()];
        self.slopes.divergence(components, &mut divergence);
        rms(divergence.into_iter())
    }
}

/// Makes a field free of divergence. Equal fields give equal bits, whatever the number of threads.
pub fn solenoidal(field: &Field, measured: &Measured) -> Solenoidal {
    let problem = Projection::new(field, measured);
    let before = problem.rms_divergence(&measured.values);
    let errors = Correlated::new(&field.layout);
    let sigma = [0, 1, 2].map(|c| measured.sigma[c].as_slice());
    let drawn = || {
        Spread::new(&errors, sigma, DRAWS, |drawn| {
            let (left, _, misfit) = problem.project(drawn, TOLERANCE_OF_ERRORS);
            (left, misfit)
        })
    };
    let project = || problem.project(measured.values.clone(), TOLERANCE);
    let ((values, solution, misfit), (spreads, expected)) = rayon::join(project, drawn);

    let shares = [0, 1, 2].map(|c| spreads[c].shares(field.layout.shape, [REACH; 3]));
    let misfit = (misfit / expected).sqrt();
    // Nearly all divergence comes from the least certain component, so the misfit corrects its uncertainty.
    let left = |c: usize| -> Vec<f64> {
        let factor = if c == problem.axis && misfit > SMOOTHED { misfit } else { 1.0 };
        measured.sigma[c].iter().zip(&shares[c]).map(|(sigma, share)| factor * sigma * share.sqrt()).collect()
    };
    let change = |c: usize| rms(values[c].iter().zip(&measured.values[c]).map(|(after, before)| after - before));
    let sigma = [0, 1, 2].map(left);
    let found = measured.field(field, values.each_ref(), sigma.each_ref());
    Solenoidal {
        divergence: [before, problem.rms_divergence(&values)],
        change_mm: [0, 1, 2].map(change),
        misfit,
        left: [0, 1, 2].map(|c| shares[c].iter().sum::<f64>() / shares[c].len() as f64),
        steps: solution.steps,
        unsolved: solution.unsolved,
        field: found,
    }
}
