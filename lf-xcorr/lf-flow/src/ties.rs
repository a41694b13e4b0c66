//! Values on a grid from the gradients between neighbours, by least squares.
//!
//! Two neighbours with data are tied if the gradient along their axis is known at one of them at least. Gaps may cut
//! the grid into parts without a tie between them. Each part is known up to a constant; its mean is set to 0.

use super::conjugate::solve;
use glam::DVec3;
use lf_core::VectorGrid;

/// Constant: maximum number of steps of the solver.
const MAX_STEPS: usize = 5000;

/// Pairs of neighbours that are tied.
pub(super) struct Ties {
    shape: [usize; 3],
    spacing_mm: [f64; 3],
    /// Whether a vector is tied to the next along x, y, z.
    is_tied: Vec<[bool; 3]>,
    /// Sum of 1 / distance^2 over the tied neighbours of a vector.
    diagonal: Vec<f64>,
    /// Number of the part of each vector, from 1; 0 for a vector without a tie.
    part: Vec<u32>,
    /// Number of parts.
    pub parts: usize,
}

/// Values that gradients give.
pub(super) struct Fitted {
    /// Values; NaN at vectors without a tie.
    pub values: Vec<f64>,
    /// RMS of the part of the gradients that no values can have, over the RMS of the gradients.
    pub misfit: f64,
    /// See [`super::conjugate::Solution::unsolved`].
    pub unsolved: Option<f64>,
}

impl Ties {
    /// Ties neighbours with data by gradients, whose components are NaN where they are not known.
    pub fn new(layout: &VectorGrid, has_data: impl Fn(usize) -> bool, gradients: &[DVec3]) -> Self {
        let (shape, spacing_mm) = (layout.shape, layout.spacing_mm);
        let count = gradients.len();
        let is_known = |i: usize, axis: usize| gradients[i][axis].is_finite();
        let tied = |i: usize| {
            [0, 1, 2].map(|axis| {
                let next = layout.neighbour(i, axis, 1).filter(|next| has_data(i) && has_data(*next));
                next.is_some_and(|next| is_known(i, axis) || is_known(next, axis))
            })
        };
        let is_tied = (0..count).map(tied).collect();
        let mut ties = Self { shape, spacing_mm, is_tied, diagonal: vec![0.0; count], part: vec![0; count], parts: 0 };
        let mut diagonal = vec![0.0; count];
        ties.pairs(|i, j, axis| {
            let weight = spacing_mm[axis].powi(-2);
            diagonal[i] += weight;
            diagonal[j] += weight;
        });
        ties.diagonal = diagonal;
        ties.number(layout);
        ties
    }

    /// Numbers the parts.
    fn number(&mut self, layout: &VectorGrid) {
        let mut open = Vec::new();
        for seed in 0..self.part.len() {
            if self.part[seed] != 0 || self.diagonal[seed] == 0.0 {
                continue;
            }
            self.parts += 1;
            self.part[seed] = self.parts as u32;
            open.push(seed);
            while let Some(i) = open.pop() {
                for axis in 0..3 {
                    let before = layout.neighbour(i, axis, -1).filter(|before| self.is_tied[*before][axis]);
                    let after = layout.neighbour(i, axis, 1).filter(|_| self.is_tied[i][axis]);
                    for near in [before, after].into_iter().flatten() {
                        if self.part[near] == 0 {
                            self.part[near] = self.parts as u32;
                            open.push(near);
                        }
                    }
                }
            }
        }
    }

    /// Vectors that are tied to a neighbour.
    pub fn count(&self) -> usize {
        self.part.iter().filter(|part| **part != 0).count()
    }

    /// Calls `pair(i, j, axis)` for every vector and its next neighbour along an axis, if they are tied.
    fn pairs(&self, mut pair: impl FnMut(usize, usize, usize)) {
        for axis in 0..3 {
            let stride: usize = self.shape[..axis].iter().product();
            for (i, _) in self.is_tied.iter().enumerate().filter(|(_, tied)| tied[axis]) {
                pair(i, i + stride, axis);
            }
        }
    }

    /// The values of gradients that are known at the same vectors.
    pub fn fit(&self, gradients: &[DVec3], tolerance: f64) -> Fitted {
        let spacing = self.spacing_mm;
        let between = |i: usize, j: usize, axis: usize| match [gradients[i][axis], gradients[j][axis]] {
            [a, b] if a.is_finite() && b.is_finite() => 0.5 * (a + b),
            [a, b] => [a, b][usize::from(!a.is_finite())],
        };
        let mut right = vec![0.0; gradients.len()];
        self.pairs(|i, j, axis| {
            let step = between(i, j, axis) / spacing[axis];
            right[i] -= step;
            right[j] += step;
        });
        let apply = |p: &[f64], out: &mut [f64]| {
            out.fill(0.0);
            self.pairs(|i, j, axis| {
                let slope = (p[j] - p[i]) / spacing[axis].powi(2);
                out[j] += slope;
                out[i] -= slope;
            });
        };
        let precondition = |rest: &[f64], out: &mut [f64]| {
            let shares = rest.iter().zip(&self.diagonal).map(|(rest, d)| if *d > 0.0 { rest / d } else { 0.0 });
            out.iter_mut().zip(shares).for_each(|(out, share)| *out = share);
        };
        let found = solve(apply, precondition, &right, vec![0.0; gradients.len()], tolerance, MAX_STEPS);
        let (mut values, [mut rest, mut all]) = (found.values, [0.0; 2]);
        self.pairs(|i, j, axis| {
            let wanted = between(i, j, axis);
            rest += ((values[j] - values[i]) / spacing[axis] - wanted).powi(2);
            all += wanted.powi(2);
        });
        self.centre(&mut values);
        Fitted { values, misfit: if all > 0.0 { (rest / all).sqrt() } else { 0.0 }, unsolved: found.unsolved }
    }

    /// Makes the mean of each part 0, and values of vectors without a tie NaN.
    fn centre(&self, values: &mut [f64]) {
        let mut sums = vec![(0.0, 0.0); self.parts + 1];
        for (part, value) in self.part.iter().zip(values.iter()) {
            let (sum, count) = &mut sums[*part as usize];
            (*sum, *count) = (*sum + value, *count + 1.0);
        }
        for (part, value) in self.part.iter().zip(values) {
            let (sum, count) = sums[*part as usize];
            *value = if *part == 0 { f64::NAN } else { *value - sum / count };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two halves of a row of seven; the gradient is known at few of them.
    #[test]
    fn parts_have_a_mean_of_zero_each_and_one_known_end_is_enough() {
        let layout = VectorGrid { shape: [7, 1, 1], spacing_mm: [0.5, 1.0, 1.0], ..VectorGrid::default() };
        let mut gradients = vec![DVec3::NAN; 7];
        (gradients[0].x, gradients[1].x, gradients[5].x) = (2.0, 4.0, -1.0);
        let ties = Ties::new(&layout, |_| true, &gradients);
        assert_eq!((ties.parts, ties.count()), (2, 6));
        let found = ties.fit(&gradients, 1e-12);
        // Steps of 0.5 mm with slopes 3 and 4, then nothing, then -1 and -1.
        let wanted = [-5.0 / 3.0, -0.5 / 3.0, 5.5 / 3.0, f64::NAN, 0.5, 0.0, -0.5];
        for (value, wanted) in found.values.iter().zip(wanted) {
            assert!((value - wanted).abs() < 1e-9 || value.is_nan() && wanted.is_nan(), "{:?}", found.values);
        }
        assert!(found.misfit < 1e-9 && found.unsolved.is_none());
        // A vector without data is not tied, whatever its neighbours know.
        let torn = Ties::new(&layout, |i| i != 1, &gradients);
        assert_eq!((torn.parts, torn.count()), (1, 3));
    }

    #[test]
    fn no_gradient_is_explained_wholly() {
        let layout = VectorGrid { shape: [3, 2, 2], spacing_mm: [1.0; 3], ..VectorGrid::default() };
        let found = Ties::new(&layout, |_| true, &[DVec3::ZERO; 12]).fit(&[DVec3::ZERO; 12], 1e-7);
        assert_eq!((found.misfit, found.values), (0.0, vec![0.0; 12]));
    }
}
