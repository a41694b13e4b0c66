//! Levenberg-Marquardt with numerical slopes, for a few parameters whose residuals come from inner fits.

use nalgebra::{DMatrix, DVector};

/// Iterations at most.
const STEPS: usize = 40;
/// Largest damping: no step that lowers the squares is left.
const MOST_DAMPING: f64 = 1e6;

/// How a search moves from step to step.
pub(crate) struct Search<'a> {
    /// Steps of the numerical slopes, one for each parameter.
    pub slope_steps: &'a [f64],
    pub damping: f64,
    /// Factors of the damping after a step that lowers the squares, and after one that does not.
    pub factors: [f64; 2],
    /// A parameter with smaller squares of its slopes is damped as if it had these.
    pub least_square: f64,
    /// A step that lowers the squares by a smaller share is the last.
    pub least_gain: f64,
}

impl Search<'_> {
    /// Minimizes the sum of the squared residuals, from `start`. An impossible place has no residuals. `moved` returns
    /// the place that a step leads to. None if `start` or a place beside it is impossible.
    pub fn run<P: Clone>(
        &self,
        start: P,
        residuals: impl Fn(&P) -> Option<DVector<f64>>,
        moved: impl Fn(&P, &DVector<f64>) -> P,
    ) -> Option<P> {
        let (mut place, mut damping) = (start.clone(), self.damping);
        let mut here = residuals(&place)?;
        let mut slopes = self.slopes(&place, &here, &residuals, &moved)?;
        for _ in 0..STEPS {
            let mut normal = slopes.tr_mul(&slopes);
            (0..normal.nrows()).for_each(|n| normal[(n, n)] += damping * normal[(n, n)].max(self.least_square));
            let Some(factors) = normal.cholesky() else { break };
            let next = moved(&place, &-factors.solve(&slopes.tr_mul(&here)));
            let Some(there) = residuals(&next).filter(|there| there.norm_squared() < here.norm_squared()) else {
                damping *= self.factors[1];
                if damping > MOST_DAMPING {
                    break;
                }
                continue;
            };
            let is_last = here.norm_squared() - there.norm_squared() < self.least_gain * here.norm_squared();
            (place, here, damping) = (next, there, damping * self.factors[0]);
            if is_last {
                break;
            }
            slopes = self.slopes(&place, &here, &residuals, &moved)?;
        }
        Some(place)
    }

    /// Slopes of the residuals along each parameter.
    pub fn slopes<P>(
        &self,
        place: &P,
        here: &DVector<f64>,
        residuals: impl Fn(&P) -> Option<DVector<f64>>,
        moved: impl Fn(&P, &DVector<f64>) -> P,
    ) -> Option<DMatrix<f64>> {
        let along = |(n, step): (usize, &f64)| {
            let mut aside = DVector::zeros(self.slope_steps.len());
            aside[n] = *step;
            Some((residuals(&moved(place, &aside))? - here) / *step)
        };
        let columns: Vec<DVector<f64>> = self.slope_steps.iter().enumerate().map(along).collect::<Option<_>>()?;
        Some(DMatrix::from_columns(&columns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley has its only minimum at (1, 1).
    #[test]
    fn the_end_of_a_bent_valley_is_found() {
        let slope_steps = [1e-6; 2];
        let search = Search {
            slope_steps: &slope_steps,
            damping: 1e-3,
            factors: [0.2, 10.0],
            least_square: 0.0,
            least_gain: 1e-12,
        };
        let residuals = |p: &[f64; 2]| Some(DVector::from_vec(vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]]));
        let moved = |p: &[f64; 2], step: &DVector<f64>| [p[0] + step[0], p[1] + step[1]];
        let [x, y] = search.run([-1.2, 1.0], residuals, moved).unwrap();
        assert!((x - 1.0).abs() < 1e-5 && (y - 1.0).abs() < 1e-5, "{x} {y}");
    }
}
