//! Gaps filled with the smoothest continuation of the measured values.

use super::conjugate::solve;
use super::roughness::Roughness;
use lf_core::VectorGrid;

/// Constant: residual at which the solver stops, and its maximum number of steps.
const TOLERANCE: f64 = 1e-6;
const MAX_STEPS: usize = 2000;

/// `values` with the unknown ones replaced, and the residual if the solver stopped before its goal. Panics if no value
/// is known.
pub(super) fn fill(layout: &VectorGrid, values: &[f64], is_known: &[bool]) -> (Vec<f64>, Option<f64>) {
    let known = |i: usize| if is_known[i] { values[i] } else { 0.0 };
    let start: Vec<f64> = (0..values.len()).map(known).collect();
    let count = is_known.iter().filter(|known| **known).count();
    assert!(count > 0, "a measured value");
    if count == values.len() {
        return (start, None);
    }
    // Solve for differences from the mean, so that values far from all known ones tend to it.
    let mean = start.iter().sum::<f64>() / count as f64;
    let roughness = Roughness::new(layout.shape);
    let masked = |out: &mut [f64]| {
        out.iter_mut().zip(is_known).filter(|(_, known)| **known).for_each(|(value, _)| *value = 0.0);
    };
    let known: Vec<f64> = (0..values.len()).map(|i| if is_known[i] { values[i] - mean } else { 0.0 }).collect();
    let mut right = vec![0.0; values.len()];
    roughness.add(-1.0, &known, &mut right);
    masked(&mut right);
    let diagonal = roughness.diagonal();
    let apply = |x: &[f64], out: &mut [f64]| {
        out.fill(0.0);
        roughness.add(1.0, x, out);
        masked(out);
    };
    let precondition = |x: &[f64], out: &mut [f64]| {
        out.iter_mut().zip(x.iter().zip(&diagonal)).for_each(|(out, (x, diagonal))| *out = x / diagonal);
    };
    let found = solve(apply, precondition, &right, vec![0.0; values.len()], TOLERANCE, MAX_STEPS);
    let filled = (0..values.len()).map(|i| if is_known[i] { values[i] } else { mean + found.values[i] }).collect();
    (filled, found.unsolved)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_in_a_plane_is_filled_with_the_plane() {
        let layout = VectorGrid { shape: [8, 7, 6], spacing_mm: [1.0; 3], ..VectorGrid::default() };
        let plane: Vec<f64> = (0..336).map(|i| 0.1 * f64::from(i % 8) - 0.2 * f64::from(i / 56)).collect();
        let is_known: Vec<bool> = (0..336).map(|i| !(150..160).contains(&i) && i != 0).collect();
        let torn: Vec<f64> = plane.iter().zip(&is_known).map(|(v, known)| if *known { *v } else { f64::NAN }).collect();
        let (found, unsolved) = fill(&layout, &torn, &is_known);
        assert_eq!(unsolved, None);
        let worst = found.iter().zip(&plane).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-3, "{worst}");
    }

    #[test]
    fn a_gap_too_long_for_the_solver_is_reported() {
        let layout = VectorGrid { shape: [6000, 2, 2], spacing_mm: [1.0; 3], ..VectorGrid::default() };
        let is_known: Vec<bool> = (0..24_000).map(|i| [0, 1, 5999].contains(&(i % 6000))).collect();
        let values: Vec<f64> = (0..24_000).map(|i| f64::from(i % 7)).collect();
        let (_, unsolved) = fill(&layout, &values, &is_known);
        assert!(unsolved.is_some_and(|residual| residual > TOLERANCE), "{unsolved:?}");
    }
}
