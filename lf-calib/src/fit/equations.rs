//! Robust least squares over many sub-images, with uncertainties by a jackknife over sources.
//!
//! All sub-images of one source (a dot at all depths, or a particle) share its errors. The normal equations are
//! therefore kept for each source: solving without one source after another shows how far the solution scatters (the
//! jackknife).
//!
//! A step is a weighted Gauss-Newton step. Weights are Tukey's and change with the residuals, so the sum of squares
//! need not fall; the caller watches a median distance and halves the steps that make it worse.

use super::{parameter::Parameter, robust::deviation, robust::tukey_weight};
use nalgebra::{DMatrix, DVector};

/// Periods per pixel of the sampling error that is assumed for the position of a sub-image. The error depends on the
/// position between the pixels, so a target whose rows are parallel to rows of pixels adds it up.
const WAVES: [f64; 2] = [1.0, 2.0];

/// Smallest pivot of the scaled normal matrix: the share of a parameter's squared effect that no other one explains.
const LEAST_PIVOT: f64 = 1e-7;

/// A measured position minus its prediction. Sub-images of one image (`exposure`) have the same sampling error.
#[derive(Clone, Default)]
pub(crate) struct Observation {
    pub off_px: [f64; 2],
    pub uncertainty_px: f64,
    /// Measured position, px. Its fraction of a pixel determines the sampling error.
    pub place_px: [f64; 2],
    /// Amplitude of the sampling error, px.
    pub sampling_px: f64,
    pub exposure: usize,
    /// Derivatives of the predicted x and of the predicted y by each parameter.
    pub slopes: [Vec<f64>; 2],
}

/// Normal equations of one source: weighted sums of derivative times derivative and of derivative times residual.
#[derive(Clone)]
pub(crate) struct SourceEquations {
    pub normal: DMatrix<f64>,
    pub right: DVector<f64>,
}

pub(crate) struct NormalEquations {
    pub parameters: Vec<Parameter>,
    pub sources: Vec<SourceEquations>,
    /// Standard deviation of the residuals over their stated uncertainties.
    pub deviation: f64,
    /// Right sides that sampling errors alone would give, for each image and wave.
    pub sampling: Vec<DVector<f64>>,
    /// Knowledge of the parameters from elsewhere. The jackknife never leaves it out.
    prior: SourceEquations,
}

pub(crate) struct ParameterEstimate {
    pub step: DVector<f64>,
    /// Covariance if sub-images were independent.
    pub independent: DMatrix<f64>,
    /// Covariance by the jackknife over sources.
    pub by_source: DMatrix<f64>,
    /// Covariance of the sampling errors.
    pub sampling: DMatrix<f64>,
}

impl NormalEquations {
    /// Sums the observations of each source with Tukey's weights.
    pub fn new(parameters: &[Parameter], sources: &[Vec<Observation>]) -> Self {
        let size = parameters.len();
        let length = |observation: &Observation| {
            let [x, y] = observation.off_px.map(|off| off / observation.uncertainty_px);
            x.hypot(y)
        };
        let scatter = deviation(sources.iter().flatten().map(length).collect());
        let (mut squares, mut count) = (0.0, 0.0);
        let exposures = sources.iter().flatten().map(|observation| observation.exposure + 1).max().unwrap_or(0);
        let mut sampling = vec![DVector::zeros(size); WAVES.len() * exposures];
        let sources = sources
            .iter()
            .map(|observations| {
                let mut source = SourceEquations { normal: DMatrix::zeros(size, size), right: DVector::zeros(size) };
                for observation in observations {
                    let trust = tukey_weight(length(observation) / scatter);
                    if trust == 0.0 {
                        continue;
                    }
                    let weight = trust / (observation.uncertainty_px * observation.uncertainty_px);
                    for ((off, slopes), place) in
                        observation.off_px.iter().zip(&observation.slopes).zip(observation.place_px)
                    {
                        let slopes = DVector::from_column_slice(slopes);
                        for (n, wave) in WAVES.iter().enumerate() {
                            let bias = observation.sampling_px * (std::f64::consts::TAU * wave * place).sin();
                            sampling[WAVES.len() * observation.exposure + n].axpy(weight * bias, &slopes, 1.0);
                        }
                        source.normal.ger(weight, &slopes, &slopes, 1.0);
                        source.right.axpy(weight * off, &slopes, 1.0);
                        squares += weight * off * off;
                        count += trust;
                    }
                }
                source
            })
            .collect();
        let deviation = (squares / (count - size as f64).max(1.0)).sqrt();
        let prior = SourceEquations { normal: DMatrix::zeros(size, size), right: DVector::zeros(size) };
        Self { parameters: parameters.to_vec(), sources, deviation, sampling, prior }
    }

    /// Adds what is known beforehand: `known` gives the step that leads a parameter there, and a standard deviation.
    pub fn with_prior(mut self, known: impl Fn(Parameter) -> Option<(f64, f64)>) -> Self {
        for (n, parameter) in self.parameters.iter().enumerate() {
            let Some((step, std)) = known(*parameter) else { continue };
            // Covariances are in squares of this deviation.
            let weight = (self.deviation / std).powi(2);
            self.prior.normal[(n, n)] += weight;
            self.prior.right[n] += weight * step;
        }
        self
    }

    /// The equations for some of the parameters; the others stay fixed.
    pub fn columns(&self, parameters: &[Parameter]) -> Self {
        let columns: Vec<usize> =
            parameters.iter().filter_map(|p| self.parameters.iter().position(|known| known == p)).collect();
        let some = |source: &SourceEquations| SourceEquations {
            normal: source.normal.select_columns(&columns).select_rows(&columns),
            right: source.right.select_rows(&columns),
        };
        let sources = self.sources.iter().map(some).collect();
        let parameters = columns.iter().map(|&column| self.parameters[column]).collect();
        let sampling = self.sampling.iter().map(|right| right.select_rows(&columns)).collect();
        Self { parameters, sources, deviation: self.deviation, sampling, prior: some(&self.prior) }
    }

    /// Solves the equations. None if some parameters cannot be separated.
    pub fn solve(&self) -> Option<ParameterEstimate> {
        let size = self.parameters.len();
        let SourceEquations { mut normal, mut right } = self.prior.clone();
        for source in &self.sources {
            normal += &source.normal;
            right += &source.right;
        }
        // Scale the columns to length 1: the parameters have units as different as mm^-1 and rad.
        let lengths: Vec<f64> = (0..size).map(|n| normal[(n, n)].sqrt()).collect();
        if lengths.iter().any(|length| !(length.is_finite() && *length > 0.0)) {
            return None;
        }
        let scaled =
            |matrix: &DMatrix<f64>| DMatrix::from_fn(size, size, |a, b| matrix[(a, b)] / (lengths[a] * lengths[b]));
        let scaled_right = |right: &DVector<f64>| DVector::from_fn(size, |n, _| right[n] / lengths[n]);
        let unit = scaled(&normal);
        let factors = unit.clone().cholesky()?;
        if factors.l_dirty().diagonal().iter().any(|pivot| pivot * pivot < LEAST_PIVOT) {
            return None;
        }
        let total = scaled_right(&right);
        let solution = factors.solve(&total);
        let independent = scaled(&(factors.inverse() * (self.deviation * self.deviation)));
        // Jackknife: solve without each source in turn.
        let used: Vec<&SourceEquations> = self.sources.iter().filter(|source| source.normal.trace() > 0.0).collect();
        let groups = used.len() as f64;
        let mut by_source = DMatrix::<f64>::zeros(size, size);
        for source in used {
            let rest = (&unit - scaled(&source.normal)).cholesky()?;
            let moved = rest.solve(&(&total - scaled_right(&source.right))) - &solution;
            by_source.ger((groups - 1.0) / groups, &moved, &moved, 1.0);
        }
        let mut sampling = DMatrix::<f64>::zeros(size, size);
        for right in &self.sampling {
            let moved = factors.solve(&scaled_right(right));
            sampling.ger(1.0, &moved, &moved, 1.0);
        }
        let step = DVector::from_fn(size, |n, _| solution[n] / lengths[n]);
        Some(ParameterEstimate { step, independent, by_source: scaled(&by_source), sampling: scaled(&sampling) })
    }
}

impl ParameterEstimate {
    /// Standard uncertainty of a parameter: the larger of the two covariances, plus the sampling errors.
    pub fn uncertainty(&self, n: usize) -> f64 {
        (self.independent[(n, n)].max(self.by_source[(n, n)]) + self.sampling[(n, n)]).sqrt()
    }

    /// Correlation of two parameters, from the geometry of the sub-images alone.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        self.independent[(a, b)] / (self.independent[(a, a)] * self.independent[(b, b)]).sqrt()
    }

    /// Evidence that parameters with these values are not 0: `values' covariance^-1 values`, the smaller of the two
    /// covariances' results. Without a real effect it is about the number of parameters.
    pub fn evidence(&self, columns: &[usize], values: &[f64]) -> f64 {
        let values = DVector::from_column_slice(values);
        let evidence = |covariance: &DMatrix<f64>| {
            let block = (covariance + &self.sampling).select_columns(columns).select_rows(columns);
            // A jackknife covariance is singular with fewer sources than parameters + 1: then there is no evidence.
            block.cholesky().map_or(0.0, |factors| values.dot(&factors.solve(&values)))
        };
        evidence(&self.independent).min(evidence(&self.by_source))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{normal, uniform};

    /// Points on a line: 40 sources of 20 observations. A source has an error of `shared`, an observation one of 0.1.
    fn sources(seed: u64, shared: f64, slope: f64) -> Vec<Vec<Observation>> {
        let mut state = seed;
        (0..40)
            .map(|n| {
                let common = shared * normal(&mut state);
                (0..20)
                    .map(|_| {
                        let at = n as f64 / 20.0 - 1.0 + 0.01 * uniform(&mut state);
                        let off = [0, 1].map(|_| slope * at + common + 0.1 * normal(&mut state));
                        let slopes = [vec![1.0, at], vec![1.0, at]];
                        Observation { off_px: off, uncertainty_px: 0.1, slopes, ..Default::default() }
                    })
                    .collect()
            })
            .collect()
    }

    const PAIR: [Parameter; 2] = [Parameter::TargetX, Parameter::TargetLeanX];

    // With sub-images counted as independent, the truth was five deviations away.
    #[test]
    fn errors_shared_by_a_source_count_in_the_uncertainty() {
        for shared in [0.0, 0.2] {
            let (mut squares, runs) = ([0.0; 2], 200);
            for seed in 1..=runs {
                let estimate = NormalEquations::new(&PAIR, &sources(seed, shared, 0.0)).solve().unwrap();
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
    fn evidence_is_large_for_a_real_effect_and_outliers_are_ignored() {
        let mut sources = sources(7, 0.05, 0.2);
        for observation in sources.iter_mut().flatten().step_by(17) {
            observation.off_px = [40.0, -30.0];
        }
        let estimate = NormalEquations::new(&PAIR, &sources).solve().unwrap();
        assert!(estimate.step[0].abs() < 0.05 && (estimate.step[1] - 0.2).abs() < 0.05);
        assert!(estimate.evidence(&[1], &[estimate.step[1]]) > 100.0);
        assert!(estimate.evidence(&[1], &[0.0]) == 0.0);
        assert!(estimate.correlation(0, 1).abs() < 0.2);
    }

    #[test]
    fn the_same_parameter_twice_is_not_solved() {
        let mut sources = sources(3, 0.0, 0.2);
        for observation in sources.iter_mut().flatten() {
            observation.slopes.iter_mut().for_each(|slopes| slopes[1] = 2.0 * slopes[0]);
        }
        let equations = NormalEquations::new(&PAIR, &sources);
        assert!(equations.solve().is_none());
        assert!(equations.columns(&PAIR[..1]).solve().is_some());
    }
}
