//! Small normal equations by Cholesky's method.

/// Most unknowns.
pub(crate) const MOST: usize = 30;

/// A symmetric positive definite matrix of `count` unknowns; its lower half is filled.
pub(crate) struct Normal {
    pub count: usize,
    pub matrix: [[f64; MOST]; MOST],
}

impl Normal {
    /// The factor L of `L L^T`; None if the matrix is not positive definite.
    pub fn factor(mut self) -> Option<Factor> {
        for j in 0..self.count {
            let row = self.matrix[j];
            let pivot = row[j] - row[..j].iter().map(|value| value * value).sum::<f64>();
            if pivot <= 0.0 || pivot.is_nan() {
                return None;
            }
            let root = pivot.sqrt();
            self.matrix[j][j] = root;
            for i in j + 1..self.count {
                let below = &mut self.matrix[i];
                let known: f64 = below[..j].iter().zip(&row[..j]).map(|(a, b)| a * b).sum();
                below[j] = (below[j] - known) / root;
            }
        }
        Some(Factor(self))
    }
}

/// A lower triangular factor.
pub(crate) struct Factor(Normal);

impl Factor {
    /// Solves `L L^T x = right` in place.
    pub fn solve(&self, right: &mut [f64; MOST]) {
        let Normal { count, matrix } = &self.0;
        for i in 0..*count {
            let known: f64 = matrix[i][..i].iter().zip(&right[..i]).map(|(a, b)| a * b).sum();
            right[i] = (right[i] - known) / matrix[i][i];
        }
        for i in (0..*count).rev() {
            right[i] /= matrix[i][i];
            let (value, row) = (right[i], matrix[i]);
            right[..i].iter_mut().zip(&row[..i]).for_each(|(below, factor)| *below -= factor * value);
        }
    }

    /// Column `n` of the inverse.
    pub fn inverse_column(&self, n: usize) -> [f64; MOST] {
        let mut column = [0.0; MOST];
        column[n] = 1.0;
        self.solve(&mut column);
        column
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_solved_and_indefinite_ones_refused() {
        // A known matrix: Lehmer's, min(i, j) / max(i, j), which is positive definite.
        let lehmer = |i: usize, j: usize| (i.min(j) + 1) as f64 / (i.max(j) + 1) as f64;
        let mut normal = Normal { count: MOST, matrix: [[0.0; MOST]; MOST] };
        (0..MOST).for_each(|i| (0..=i).for_each(|j| normal.matrix[i][j] = lehmer(i, j)));
        let wanted: [f64; MOST] = std::array::from_fn(|i| (i as f64 * 0.7).sin());
        let mut found = std::array::from_fn(|i| (0..MOST).map(|j| lehmer(i, j) * wanted[j]).sum());
        let factor = normal.factor().unwrap();
        factor.solve(&mut found);
        assert!(found.iter().zip(&wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-9));
        let column = factor.inverse_column(4);
        let product: f64 = (0..MOST).map(|j| lehmer(4, j) * column[j]).sum();
        assert!((product - 1.0).abs() < 1e-9);
        let mut indefinite = Normal { count: 2, matrix: [[0.0; MOST]; MOST] };
        (indefinite.matrix[0][0], indefinite.matrix[1][0], indefinite.matrix[1][1]) = (1.0, 2.0, 1.0);
        assert!(indefinite.factor().is_none());
    }
}
