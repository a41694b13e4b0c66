//! Least squares over many spots of light, deaf to outliers, with uncertainties that count what hangs together.
//!
//! The spots of one source (a dot through all depths, or a particle) share what is wrong with it. Normal equations are
//! therefore kept by source: left out one after another they tell how far the solution scatters, without a belief in the
//! independence of spots (the jackknife).

use crate::fan::{scale, trust};
use crate::parameters::Parameter;
use nalgebra::{DMatrix, DVector};

/// What sampling leaves in a spot's place is taken for waves over a pixel and over half of one. A target whose rows lie on rows
/// of pixels adds them up.
const WAVES: [f64; 2] = [1.0, 2.0];

/// What is left of the square of what a parameter does to spots where the others have taken theirs: below, they are the same.
const SAME: f64 = 1e-7;

/// What one spot says: measured less predicted, the slopes of the prediction, and how well its place is known.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Line {
    /// Measured less predicted along x and y, px.
    pub off_px: [f64; 2],
    /// Standard uncertainty of each, px.
    pub uncertainty_px: f64,
    /// Where it was measured, px: between which pixels tells what sampling does to it.
    pub place_px: [f64; 2],
    /// What sampling may do to its place, px.
    pub sampling_px: f64,
    /// Spots of one exposure look alike, and sampling does the same to them.
    pub exposure: usize,
    /// Slopes along x by each parameter.
    pub slopes: [Vec<f64>; 2],
}

/// The normal equations of one source.
#[derive(Debug, Clone)]
pub(crate) struct Share {
    /// Sum of slope times slope.
    pub normal: DMatrix<f64>,
    /// Sum of slope times what is off.
    pub right: DVector<f64>,
}

/// The normal equations of all sources.
#[derive(Debug, Clone)]
pub(crate) struct Equations {
    /// What the columns are.
    pub parameters: Vec<Parameter>,
    /// By source.
    pub shares: Vec<Share>,
    /// Standard deviation of what is off, in stated uncertainties.
    pub deviation: f64,
    /// Right sides of what sampling may do, by exposure and wave.
    pub sampling: Vec<DVector<f64>>,
}

/// A step of parameters and how well it is known.
#[derive(Debug, Clone)]
pub(crate) struct Estimate {
    /// Change of each parameter.
    pub step: DVector<f64>,
    /// Covariance if spots were independent.
    pub independent: DMatrix<f64>,
    /// Covariance by leaving out source after source.
    pub by_source: DMatrix<f64>,
    /// Covariance of what sampling leaves.
    pub sampling: DMatrix<f64>,
}

impl Equations {
    /// The lines of each source with Tukey's weights.
    pub fn new(parameters: &[Parameter], sources: &[Vec<Line>]) -> Self {
        let size = parameters.len();
        let parts = |line: &Line| line.off_px.map(|off| off / line.uncertainty_px);
        let length = |line: &Line| parts(line)[0].hypot(parts(line)[1]);
        let scatter = scale(sources.iter().flatten().map(length).collect());
        let (mut squares, mut count) = (0.0, 0.0);
        let exposures = sources.iter().flatten().map(|line| line.exposure + 1).max().unwrap_or(0);
        let mut sampling = vec![DVector::zeros(size); WAVES.len() * exposures];
        let shares = sources
            .iter()
            .map(|lines| {
                let mut share = Share { normal: DMatrix::zeros(size, size), right: DVector::zeros(size) };
                for line in lines {
                    let trust = trust(length(line) / scatter);
                    if trust == 0.0 {
                        continue;
                    }
                    let weight = trust / (line.uncertainty_px * line.uncertainty_px);
                    for ((off, slopes), place) in line.off_px.iter().zip(&line.slopes).zip(line.place_px) {
                        let slopes = DVector::from_column_slice(slopes);
                        for (n, wave) in WAVES.iter().enumerate() {
                            let bias = line.sampling_px * (std::f64::consts::TAU * wave * place).sin();
                            sampling[WAVES.len() * line.exposure + n].axpy(weight * bias, &slopes, 1.0);
                        }
                        share.normal.ger(weight, &slopes, &slopes, 1.0);
                        share.right.axpy(weight * off, &slopes, 1.0);
                        squares += weight * off * off;
                        count += trust;
                    }
                }
                share
            })
            .collect();
        let deviation = (squares / (count - size as f64).max(1.0)).sqrt();
        Self { parameters: parameters.to_vec(), shares, deviation, sampling }
    }

    /// The columns of some of the parameters.
    pub fn of(&self, parameters: &[Parameter]) -> Self {
        let columns: Vec<usize> =
            parameters.iter().filter_map(|p| self.parameters.iter().position(|known| known == p)).collect();
        let shares = self
            .shares
            .iter()
            .map(|share| Share {
                normal: share.normal.select_columns(&columns).select_rows(&columns),
                right: share.right.select_rows(&columns),
            })
            .collect();
        let parameters = columns.iter().map(|&column| self.parameters[column]).collect();
        let sampling = self.sampling.iter().map(|right| right.select_rows(&columns)).collect();
        Self { parameters, shares, deviation: self.deviation, sampling }
    }

    /// Solves; none where some parameters cannot be told apart. `damping` is Marquardt's: added to the diagonal as a share
    /// of it; the covariances take no notice of it.
    pub fn solve(&self, damping: f64) -> Option<Estimate> {
        let size = self.parameters.len();
        let mut normal = DMatrix::<f64>::zeros(size, size);
        let mut right = DVector::<f64>::zeros(size);
        for share in &self.shares {
            normal += &share.normal;
            right += &share.right;
        }
        // Columns of length 1: parameters have units as far apart as mm^-1 and rad.
        let lengths: Vec<f64> = (0..size).map(|n| normal[(n, n)].sqrt()).collect();
        if lengths.iter().any(|length| !(length.is_finite() && *length > 0.0)) {
            return None;
        }
        let scaled =
            |matrix: &DMatrix<f64>| DMatrix::from_fn(size, size, |a, b| matrix[(a, b)] / (lengths[a] * lengths[b]));
        let scaled_right = |right: &DVector<f64>| DVector::from_fn(size, |n, _| right[n] / lengths[n]);
        let unit = scaled(&normal);
        let factors = unit.clone().cholesky()?;
        if factors.l_dirty().diagonal().iter().any(|pivot| pivot * pivot < SAME) {
            return None;
        }
        let mut damped = unit.clone();
        (0..size).for_each(|n| damped[(n, n)] *= 1.0 + damping);
        let total = scaled_right(&right);
        let solution = damped.cholesky()?.solve(&total);
        let undamped = factors.solve(&total);
        let back =
            |matrix: DMatrix<f64>| DMatrix::from_fn(size, size, |a, b| matrix[(a, b)] / (lengths[a] * lengths[b]));
        let independent = back(factors.inverse() * (self.deviation * self.deviation));
        let used: Vec<&Share> = self.shares.iter().filter(|share| share.normal.trace() > 0.0).collect();
        let groups = used.len() as f64;
        let mut by_source = DMatrix::<f64>::zeros(size, size);
        for share in used {
            let rest = (&unit - scaled(&share.normal)).cholesky()?;
            let without = rest.solve(&(&total - scaled_right(&share.right))) - &undamped;
            by_source.ger((groups - 1.0) / groups, &without, &without, 1.0);
        }
        let mut sampling = DMatrix::<f64>::zeros(size, size);
        for right in &self.sampling {
            let moved = factors.solve(&scaled_right(right));
            sampling.ger(1.0, &moved, &moved, 1.0);
        }
        let step = DVector::from_fn(size, |n, _| solution[n] / lengths[n]);
        Some(Estimate { step, independent, by_source: back(by_source), sampling: back(sampling) })
    }
}

impl Estimate {
    /// Standard uncertainty of a parameter: the larger of what independent spots and what sources say, and what sampling leaves.
    pub fn uncertainty(&self, n: usize) -> f64 {
        (self.independent[(n, n)].max(self.by_source[(n, n)]) + self.sampling[(n, n)]).sqrt()
    }

    /// Correlation of two parameters by the geometry of the spots.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        self.independent[(a, b)] / (self.independent[(a, a)] * self.independent[(b, b)]).sqrt()
    }

    /// Evidence that some parameters are not 0, given what they are now: `value' covariance^-1 value`, the smaller of what
    /// either covariance says; it is about as many as there are parameters where there is none.
    pub fn evidence(&self, columns: &[usize], values: &[f64]) -> f64 {
        let values = DVector::from_column_slice(values);
        let of = |covariance: &DMatrix<f64>| {
            let block = (covariance + &self.sampling).select_columns(columns).select_rows(columns);
            // One source more than parameters is needed to fill a covariance; without, there is no evidence.
            block.cholesky().map_or(0.0, |factors| values.dot(&factors.solve(&values)))
        };
        of(&self.independent).min(of(&self.by_source))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(state: &mut u64) -> f64 {
        (0..12).map(|_| uniform(state)).sum::<f64>() - 6.0
    }

    /// A line through sources of 20 places; each source off by `shared`, each place by 0.1 on its own.
    fn sources(seed: u64, shared: f64, slope: f64) -> Vec<Vec<Line>> {
        let mut state = seed;
        (0..40)
            .map(|n| {
                let common = shared * normal(&mut state);
                (0..20)
                    .map(|_| {
                        let at = n as f64 / 20.0 - 1.0 + 0.01 * uniform(&mut state);
                        let off = [0, 1].map(|_| slope * at + common + 0.1 * normal(&mut state));
                        Line {
                            off_px: off,
                            uncertainty_px: 0.1,
                            place_px: [0.0; 2],
                            sampling_px: 0.0,
                            exposure: 0,
                            slopes: [vec![1.0, at], vec![1.0, at]],
                        }
                    })
                    .collect()
            })
            .collect()
    }

    const PAIR: [Parameter; 2] = [Parameter::TargetX, Parameter::TargetLeanX];

    // Spots of one dot share its error: with uncertainties from independent spots the truth was five of them away.
    #[test]
    fn what_sources_share_counts_in_the_uncertainty() {
        for shared in [0.0, 0.2] {
            let (mut squares, runs) = ([0.0; 2], 200);
            for seed in 1..=runs {
                let estimate = Equations::new(&PAIR, &sources(seed, shared, 0.0)).solve(0.0).unwrap();
                for n in 0..2 {
                    squares[n] += (estimate.step[n] / estimate.uncertainty(n)).powi(2);
                }
            }
            for square in squares {
                let ratio = (square / runs as f64).sqrt();
                assert!((0.7..1.25).contains(&ratio), "{shared}: {ratio}");
            }
        }
    }

    #[test]
    fn evidence_is_large_for_what_is_there_and_outliers_are_not_heard() {
        let mut sources = sources(7, 0.05, 0.2);
        for line in sources.iter_mut().flatten().step_by(17) {
            line.off_px = [40.0, -30.0];
        }
        let estimate = Equations::new(&PAIR, &sources).solve(0.0).unwrap();
        assert!(estimate.step[0].abs() < 0.05 && (estimate.step[1] - 0.2).abs() < 0.05);
        assert!(estimate.evidence(&[1], &[estimate.step[1]]) > 100.0);
        assert!(estimate.evidence(&[1], &[0.0]) == 0.0);
        assert!(estimate.correlation(0, 1).abs() < 0.2);
    }

    #[test]
    fn the_same_parameter_twice_is_not_solved() {
        let mut sources = sources(3, 0.0, 0.2);
        for line in sources.iter_mut().flatten() {
            line.slopes.iter_mut().for_each(|slopes| slopes[1] = 2.0 * slopes[0]);
        }
        let equations = Equations::new(&PAIR, &sources);
        assert!(equations.solve(0.0).is_none());
        assert!(equations.of(&PAIR[..1]).solve(0.0).is_some());
    }
}
