//! Means over windows, of values that stand on the grid of the vectors.
//!
//! A vector is the mean of the flow over its window. The mean leaves out what bends inside the window; no treatment of
//! the vectors removes this error.

use super::spread::along_lines;
use lf_core::VectorGrid;

/// Weights of the places 0, 1, ... steps from a window's centre along an axis: their shares of its length.
fn weights(layout: &VectorGrid, axis: usize) -> Vec<f64> {
    let half = (0.5 * layout.window_in_spacings(axis)).max(0.5);
    let share = |step: usize| (half - step as f64 + 0.5).clamp(0.0, 1.0) / (2.0 * half);
    let mut weights: Vec<f64> = (0..=half as usize + 1).map(share).collect();
    weights[0] = 1.0 / (2.0 * half);
    weights
}

/// The mean of `values` over the window of each vector. Beyond the ends of an axis the values continue mirrored in the
/// last one, so that a slope makes no difference.
pub(super) fn window_means(layout: &VectorGrid, values: &[f64]) -> Vec<f64> {
    let weights = [0, 1, 2].map(|axis| weights(layout, axis));
    along_lines(values, layout.shape, |axis, at, line| {
        let last = layout.shape[axis] - 1;
        let value = |place: usize| line(place.min(last));
        let before = |step: usize| if step <= at { value(at - step) } else { 2.0 * value(0) - value(step - at) };
        let after = |step: usize| match last.checked_sub(at + step) {
            Some(_) => value(at + step),
            None => 2.0 * value(last) - value((2 * last).saturating_sub(at + step)),
        };
        let sides = weights[axis].iter().enumerate().skip(1);
        let sides = sides.map(|(step, weight)| weight * (before(step) + after(step)));
        weights[axis][0] * line(at) + sides.sum::<f64>()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quadratic bends by a twenty-fourth of its second derivative times the window's square; a slope does not. On a
    /// grid of four vectors to a window the sum of shares stands for the integral: 1.5 steps squared of 16 / 12.
    #[test]
    fn a_quadratic_bends_and_a_plane_does_not() {
        let layout = VectorGrid {
            shape: [12, 9, 5],
            spacing_mm: [0.5; 3],
            voxel_mm: [0.125, 0.5, 0.5],
            window: [16, 1, 3],
            ..VectorGrid::default()
        };
        let place = |i: usize| [(i % 12) as f64, (i / 12 % 9) as f64, (i / 108) as f64];
        let all = 12 * 9 * 5;
        let plane: Vec<f64> = (0..all).map(place).map(|[x, y, z]| 0.5 * x - y + 2.0 * z).collect();
        let worst = window_means(&layout, &plane).iter().zip(&plane).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-12, "{worst}");
        let bent: Vec<f64> = (0..all).map(place).map(|[x, ..]| x * x).collect();
        let means = window_means(&layout, &bent);
        for i in (0..all).filter(|i| (2..10).contains(&(i % 12))) {
            assert!((means[i] - bent[i] - 1.5).abs() < 1e-12, "{i}");
        }
    }
}
