//! Conjugate gradients with a preconditioner (Hestenes & Stiefel 1952), for matrices that are only applied.
//!
//! The matrices here have about 10 entries in a row and a known structure, so that applying them takes a few lines and
//! no memory. A sparse factorisation of 74,088 unknowns in three dimensions takes gigabytes.

/// A solution, and what it took.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Solution {
    pub values: Vec<f64>,
    pub steps: usize,
    /// Norm of the residual over that of the right side, if the solver stopped above the tolerance that was asked for.
    pub unsolved: Option<f64>,
}

/// Solves `apply(x) = right` for a symmetric matrix without negative eigenvalues. `apply` and `precondition` write into
/// their second argument. Ends when the residual is `tolerance` of the right side, or after `max_steps`.
pub(super) fn solve(
    mut apply: impl FnMut(&[f64], &mut [f64]),
    mut precondition: impl FnMut(&[f64], &mut [f64]),
    right: &[f64],
    start: Vec<f64>,
    tolerance: f64,
    max_steps: usize,
) -> Solution {
    // Start from the residual of `start`.
    let count = right.len();
    let mut values = start;
    let (mut applied, mut better) = (vec![0.0; count], vec![0.0; count]);
    apply(&values, &mut applied);
    let mut rest: Vec<f64> = right.iter().zip(&applied).map(|(right, applied)| right - applied).collect();
    let goal = dot(right, right);
    if goal == 0.0 {
        return Solution { values: vec![0.0; count], steps: 0, unsolved: None };
    }
    precondition(&rest, &mut better);
    let mut direction = better.clone();
    let mut descent = dot(&rest, &better);
    let mut steps = 0;
    while dot(&rest, &rest) > tolerance * tolerance * goal && steps < max_steps {
        apply(&direction, &mut applied);
        let curvature = dot(&direction, &applied);
        if curvature <= 0.0 {
            break;
        }
        // Go to the minimum along the direction.
        let length = descent / curvature;
        add(&mut values, length, &direction);
        add(&mut rest, -length, &applied);
        // Turn the preconditioned residual away from the directions before.
        precondition(&rest, &mut better);
        let next = dot(&rest, &better);
        let turn = next / descent;
        descent = next;
        direction.iter_mut().zip(&better).for_each(|(direction, better)| *direction = better + turn * *direction);
        steps += 1;
    }
    // Judge the values by their true residual.
    apply(&values, &mut applied);
    let rest: Vec<f64> = right.iter().zip(&applied).map(|(right, applied)| right - applied).collect();
    let residual = (dot(&rest, &rest) / goal).sqrt();
    // Rounding lets the residual of the steps depart a little from the true one.
    let is_solved = residual <= 2.0 * tolerance;
    Solution { values, steps, unsolved: (!is_solved).then_some(residual) }
}

/// Sum of products, in four lanes.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum::<f64>() + rest
}

fn add(values: &mut [f64], factor: f64, other: &[f64]) {
    values.iter_mut().zip(other).for_each(|(value, other)| *value += factor * other);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_system_is_solved_with_and_without_a_preconditioner() {
        let matrix = [[4.0, 1.0, 0.0], [1.0, 300.0, -2.0], [0.0, -2.0, 5.0]];
        let apply = |x: &[f64], out: &mut [f64]| (0..3).for_each(|i| out[i] = dot(&matrix[i], x));
        let wanted = [1.0, -2.0, 3.0];
        let mut right = [0.0; 3];
        apply(&wanted, &mut right);
        let plain = solve(apply, |x, out| out.copy_from_slice(x), &right, vec![0.0; 3], 1e-12, 10);
        let scaled = |x: &[f64], out: &mut [f64]| (0..3).for_each(|i| out[i] = x[i] / matrix[i][i]);
        let better = solve(apply, scaled, &right, vec![9.0; 3], 1e-12, 10);
        for found in [plain, better] {
            assert!(found.steps <= 4 && found.unsolved.is_none(), "{found:?}");
            assert!(found.values.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        }
        // Scar: rounding of very large numbers ended the steps, and the result counted as solved.
        let huge = |x: &[f64], out: &mut [f64]| (0..3).for_each(|i| out[i] = 1e30 * dot(&matrix[i], x) + x[i]);
        let lost = solve(huge, |x, out| out.copy_from_slice(x), &right, right.to_vec(), 1e-12, 100);
        assert!(lost.unsolved.is_some(), "{lost:?}");
        let stopped = solve(apply, |x, out| out.copy_from_slice(x), &right, vec![0.0; 3], 1e-12, 1);
        assert!(stopped.unsolved.is_some_and(|residual| residual > 1e-3), "{stopped:?}");
    }
}
