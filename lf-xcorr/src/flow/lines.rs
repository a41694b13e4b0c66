//! A preconditioner for the divergence's normal matrix: exact along one axis, diagonal along the others.
//!
//! Equation: the matrix is `D S D'`, with the divergence D and the variances S. Along the axis whose component is by
//! far the least certain, its part outweighs the rest, and it couples places of one line only, two apart. So the lines
//! of that part, with the diagonal of the rest, are solved exactly: `L d L'` with two bands.

use super::slopes::{Slopes, ends};

/// The factors of all lines along an axis.
pub(super) struct Lines {
    stride: usize,
    count: usize,
    /// 1 / d at each place.
    inverse: Vec<f64>,
    /// L one and two places before each place.
    below: [Vec<f64>; 2],
}

impl Lines {
    /// Factors the lines along `axis` for components of these variances.
    pub fn new(slopes: &Slopes, variances: &[Vec<f64>; 3], axis: usize) -> Self {
        let (count, stride) = (slopes.shape()[axis], slopes.stride(axis));
        let len = variances[axis].len();
        let diagonal = rest(slopes, variances, axis);
        let mut lines = Self { stride, count, inverse: vec![0.0; len], below: [vec![0.0; len], vec![0.0; len]] };
        // The entry of D S D' between two places of a line that starts at `first`.
        let entry = |first: usize, i: usize, j: usize| {
            let ([a, b], [c, d]) = (ends(i, count), ends(j, count));
            let shared = |p: usize, q: usize| if p == q { variances[axis][first + p * stride] } else { 0.0 };
            let sum = shared(b, d) + shared(a, c) - shared(b, c) - shared(a, d);
            slopes.factor(axis, i) * slopes.factor(axis, j) * sum
        };
        for first in (0..len).filter(|i| i / stride % count == 0) {
            let mut d = vec![0.0; count];
            for i in 0..count {
                let at = first + i * stride;
                let l2 = if i >= 2 { entry(first, i, i - 2) / d[i - 2] } else { 0.0 };
                let cross = if i >= 2 { l2 * d[i - 2] * lines.below[0][at - stride] } else { 0.0 };
                let l1 = if i >= 1 { (entry(first, i, i - 1) - cross) / d[i - 1] } else { 0.0 };
                let own = entry(first, i, i) + diagonal[at];
                d[i] = own;
                if i >= 1 {
                    d[i] -= l1 * l1 * d[i - 1];
                }
                if i >= 2 {
                    d[i] -= l2 * l2 * d[i - 2];
                }
                // Rounding may leave nothing of a line that the other axes do not hold.
                d[i] = d[i].max(1e-12 * own);
                (lines.below[0][at], lines.below[1][at], lines.inverse[at]) = (l1, l2, 1.0 / d[i]);
            }
        }
        lines
    }

    /// Solves all lines for `right`.
    pub fn solve(&self, right: &[f64], out: &mut [f64]) {
        let Self { stride, count, inverse, below: [l1, l2] } = self;
        out.copy_from_slice(right);
        let block = stride * count;
        // Rows of lines side by side: forwards, then backwards.
        for first in (0..out.len()).step_by(block) {
            for at in (first + stride..first + block).step_by(*stride) {
                for i in at..at + stride {
                    let before = if at >= first + 2 * stride { l2[i] * out[i - 2 * stride] } else { 0.0 };
                    out[i] -= l1[i] * out[i - stride] + before;
                }
            }
            for at in (first..first + block).step_by(*stride).rev() {
                for i in at..at + stride {
                    let mut value = out[i] * inverse[i];
                    if i + stride < first + block {
                        value -= l1[i + stride] * out[i + stride];
                    }
                    if i + 2 * stride < first + block {
                        value -= l2[i + 2 * stride] * out[i + 2 * stride];
                    }
                    out[i] = value;
                }
            }
        }
    }
}

/// Diagonal of the parts of `D S D'` along the axes other than `axis`.
fn rest(slopes: &Slopes, variances: &[Vec<f64>; 3], axis: usize) -> Vec<f64> {
    let mut diagonal = vec![0.0; variances[axis].len()];
    for other in (0..3).filter(|other| *other != axis) {
        let (count, stride) = (slopes.shape()[other], slopes.stride(other));
        for (i, sum) in diagonal.iter_mut().enumerate() {
            let at = i / stride % count;
            let [low, high] = ends(at, count).map(|end| variances[other][i + end * stride - at * stride]);
            *sum += slopes.factor(other, at).powi(2) * (low + high);
        }
    }
    diagonal
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::VectorGrid;

    /// With no variance in the other components but a little, the lines are the whole matrix.
    #[test]
    fn lines_alone_are_solved_exactly() {
        for axis in 0..3 {
            let layout = VectorGrid { shape: [5, 4, 6], spacing_mm: [0.5, 1.0, 2.0], ..VectorGrid::default() };
            let slopes = Slopes::new(&layout);
            let mut variances = [vec![0.0; 120], vec![0.0; 120], vec![0.0; 120]];
            variances[axis] = (0..120).map(|i| 1.0 + f64::from(i % 7)).collect();
            let other = (axis + 1) % 3;
            variances[other] = vec![1e-3; 120];
            let diagonal = rest(&slopes, &variances, axis);
            let lines = Lines::new(&slopes, &variances, axis);
            let wanted: Vec<f64> = (0..120).map(|i| f64::from(i * i % 31) - 15.0).collect();
            let [mut back, mut right, mut found] = [vec![0.0; 120], vec![0.0; 120], vec![0.0; 120]];
            slopes.add_transposed(axis, &wanted, &mut back);
            back.iter_mut().zip(&variances[axis]).for_each(|(value, variance)| *value *= variance);
            slopes.add(axis, &back, &mut right);
            right.iter_mut().zip(diagonal.iter().zip(&wanted)).for_each(|(sum, (d, value))| *sum += d * value);
            lines.solve(&right, &mut found);
            let worst = found.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-6, "{axis}: {worst}");
        }
    }
}
