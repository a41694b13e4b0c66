//! Dense linear algebra of symmetric positive definite matrices, row by row in slices.
//!
//! Only the lower triangle of a matrix is read. [`cholesky_above`] and [`solve`] take sums in order; [`cholesky`] and
//! [`solve_lower`] take them in lanes, which is several times as fast for hundreds of unknowns.

use crate::simd::fastest;

/// Lanes of a sum.
const LANES: usize = 8;

/// Sum of products, in lanes.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (a, b) in a.iter().zip(b) {
        for n in 0..LANES {
            sums[n] += a[n] * b[n];
        }
    }
    let mut rest = 0.0;
    for (a, b) in a_rest.iter().zip(b_rest) {
        rest += a * b;
    }
    sums.iter().sum::<f64>() + rest
}

/// Replaces the lower triangle of `matrix` by its Cholesky factor L, `matrix = L L'`. None if a pivot is not above
/// `least` times the matrix's value there: the matrix is singular or not positive definite.
#[must_use]
pub fn cholesky(matrix: &mut [f64], size: usize, least: f64) -> Option<()> {
    let mut done = None;
    fastest(
        #[inline(always)]
        || done = cholesky_by_rows(matrix, size, least),
    );
    done
}

#[inline(always)]
fn cholesky_by_rows(matrix: &mut [f64], size: usize, least: f64) -> Option<()> {
    for i in 0..size {
        let (above, below) = matrix.split_at_mut(i * size);
        let row = &mut below[..=i];
        for (j, other) in above.chunks_exact(size).enumerate() {
            row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
        }
        let pivot = row[i] - dot(&row[..i], &row[..i]);
        if pivot.is_nan() || pivot <= least * row[i] {
            return None;
        }
        row[i] = pivot.sqrt();
    }
    Some(())
}

/// Replaces the lower triangle of `matrix` by its Cholesky factor L. Pivots below `floor(column, diagonal value)` are
/// raised to it, so that rounding cannot make the rows below overflow.
pub fn cholesky_above(matrix: &mut [f64], size: usize, floor: impl Fn(usize, f64) -> f64) {
    for column in 0..size {
        let own = matrix[column * size + column];
        for row in column..size {
            let mut sum = matrix[row * size + column];
            for k in 0..column {
                sum -= matrix[row * size + k] * matrix[column * size + k];
            }
            matrix[row * size + column] =
                if row == column { sum.max(floor(column, own)).sqrt() } else { sum / matrix[column * size + column] };
        }
    }
}

/// Solves `L x = b` in place.
pub fn solve_lower(lower: &[f64], b: &mut [f64]) {
    for (i, row) in lower.chunks_exact(b.len()).enumerate() {
        b[i] = (b[i] - dot(&row[..i], &b[..i])) / row[i];
    }
}

/// Solves `L L' x = b` in place.
pub fn solve(lower: &[f64], b: &mut [f64]) {
    let size = b.len();
    for row in 0..size {
        for k in 0..row {
            b[row] -= lower[row * size + k] * b[k];
        }
        b[row] /= lower[row * size + row];
    }
    for row in (0..size).rev() {
        for k in row + 1..size {
            b[row] -= lower[k * size + row] * b[k];
        }
        b[row] /= lower[row * size + row];
    }
}

/// Column `n` of the inverse of `L L'`.
pub fn inverse_column(lower: &[f64], size: usize, n: usize) -> Vec<f64> {
    let mut column = vec![0.0; size];
    column[n] = 1.0;
    solve(lower, &mut column);
    column
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 21;

    /// Lehmer's matrix, min(i, j) / max(i, j), is positive definite; its inverse is known and has three diagonals.
    fn lehmer(i: usize, j: usize) -> f64 {
        (i.min(j) + 1) as f64 / (i.max(j) + 1) as f64
    }

    fn matrix() -> Vec<f64> {
        (0..SIZE * SIZE).map(|n| lehmer(n / SIZE, n % SIZE)).collect()
    }

    /// Both factors are the same to rounding, and L L' is the matrix.
    #[test]
    fn factors_multiply_to_the_matrix() {
        let (mut lanes, mut ordered) = (matrix(), matrix());
        cholesky(&mut lanes, SIZE, 1e-12).unwrap();
        cholesky_above(&mut ordered, SIZE, |_, _| 0.0);
        for i in 0..SIZE {
            for j in 0..=i {
                assert!((lanes[i * SIZE + j] - ordered[i * SIZE + j]).abs() < 1e-14, "{i} {j}");
                let product: f64 = (0..=j).map(|k| lanes[i * SIZE + k] * lanes[j * SIZE + k]).sum();
                assert!((product - lehmer(i, j)).abs() < 1e-15, "{i} {j}: {product}");
            }
        }
    }

    #[test]
    fn equations_are_solved() {
        let mut lower = matrix();
        cholesky(&mut lower, SIZE, 0.0).unwrap();
        let wanted: Vec<f64> = (0..SIZE).map(|i| (i as f64 * 0.7).sin()).collect();
        let right = |i: usize| (0..SIZE).map(|j| lehmer(i, j) * wanted[j]).sum::<f64>();
        let mut found: Vec<f64> = (0..SIZE).map(right).collect();
        solve(&lower, &mut found);
        assert!(found.iter().zip(&wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-13), "{found:?}");
        // The known inverse: 4 i^3 / (4 i^2 - 1) on the diagonal, i counted from 1, -i (i + 1) / (2 i + 1) beside it.
        let column = inverse_column(&lower, SIZE, 4);
        let known = [(3, -20.0 / 9.0), (4, 500.0 / 99.0), (5, -30.0 / 11.0), (9, 0.0)];
        known.iter().for_each(|(n, wanted)| assert!((column[*n] - wanted).abs() < 1e-12, "{n}: {}", column[*n]));
        // L x = b, and then the product with L again.
        let mut half: Vec<f64> = (0..SIZE).map(right).collect();
        solve_lower(&lower, &mut half);
        for i in 0..SIZE {
            let product: f64 = (0..=i).map(|k| lower[i * SIZE + k] * half[k]).sum();
            assert!((product - right(i)).abs() < 1e-14, "{i}");
        }
    }

    /// A matrix that is not positive definite is refused, and with a floor its factor stays finite.
    #[test]
    fn pivots_have_a_floor() {
        assert!(cholesky(&mut [1.0, 0.0, 2.0, 1.0], 2, 0.0).is_none());
        assert!(cholesky(&mut [1.0, 0.0, f64::NAN, 1.0], 2, 0.0).is_none());
        assert!(cholesky(&mut [1.0, 0.0, 1.0, 1.0 + 1e-9], 2, 1e-8).is_none());
        let mut matrix = [1.0, 0.0, 2.0, 1.0];
        cholesky_above(&mut matrix, 2, |_, own| 0.25 * own);
        assert_eq!(matrix, [1.0, 0.0, 2.0, 0.5]);
    }
}
