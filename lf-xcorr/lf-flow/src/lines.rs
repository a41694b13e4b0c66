//! A preconditioner for the divergence's normal matrix: exact along one axis, diagonal along the others.
//!
//! Equation: the matrix is `D S D'`, with the divergence D and the variances S. Along the axis whose component is by
//! far the least certain, its part outweighs the rest, and it couples places of one line only, two apart. So the lines
//! of that part, with the diagonal of the rest, are solved exactly: `L d L'` with two bands.

use super::bands::Bands;
use super::slopes::{Slopes, ends};

/// The factors of all lines along `axis` for components of these variances.
pub(super) fn lines(slopes: &Slopes, variances: &[Vec<f64>; 3], axis: usize) -> Bands {
    let (count, stride) = (slopes.shape()[axis], slopes.stride(axis));
    let diagonal = rest(slopes, variances, axis);
    // The entry of D S D' between two places of a line, and the diagonal of the rest.
    let entry = |first: usize, i: usize, back: usize| {
        let ([a, b], [c, d]) = (ends(i, count), ends(i - back, count));
        let shared = |p: usize, q: usize| if p == q { variances[axis][first + p * stride] } else { 0.0 };
        let sum = shared(b, d) + shared(a, c) - shared(b, c) - shared(a, d);
        let others = if back == 0 { diagonal[first + i * stride] } else { 0.0 };
        slopes.factor(axis, i) * slopes.factor(axis, i - back) * sum + others
    };
    Bands::new(stride, count, variances[axis].len(), entry)
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
            let lines = lines(&slopes, &variances, axis);
            let wanted: Vec<f64> = (0..120).map(|i| f64::from(i * i % 31) - 15.0).collect();
            let [mut back, mut right] = [vec![0.0; 120], vec![0.0; 120]];
            slopes.add_transposed(axis, &wanted, &mut back);
            back.iter_mut().zip(&variances[axis]).for_each(|(value, variance)| *value *= variance);
            slopes.add(axis, &back, &mut right);
            right.iter_mut().zip(diagonal.iter().zip(&wanted)).for_each(|(sum, (d, value))| *sum += d * value);
            lines.solve(&mut right);
            let worst = right.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-6, "{axis}: {worst}");
        }
    }
}
