//! Proper orthogonal modes of a set of fields, by the method of snapshots (Sirovich, Q. Appl. Math. 45, 1987).
//!
//! Equation: the matrix of mean products of two fields' fluctuations, `C = <u_i, u_j> / n`, has the eigenvalues lambda,
//! the mean square that each mode carries, and the eigenvectors a. A mode is `sum a_i u_i / sqrt(n)`: its mean square
//! is lambda, and field i holds it `sqrt(n) a_i` times.

use lf_core::Field;
use lf_core::field::{MEASURED, NO_DATA};
use nalgebra::{DMatrix, SymmetricEigen};
use serde::Serialize;

/// Fluctuations of all fields.
#[derive(Debug, Clone, Default)]
pub struct ModeSums {
    /// u, v, w of every place, one place after another; 0 without data.
    fluctuations: Vec<Vec<f32>>,
}

/// Modes of a set of fields.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModeStatistics {
    /// Share of the mean square fluctuation that each mode carries, largest first.
    pub share: Vec<f64>,
    /// RMS displacement of each mode, mm.
    pub rms_mm: Vec<f64>,
    /// How much of a mode each field holds, a list a mode: mean square 1.
    pub amount: Vec<Vec<f64>>,
}

impl ModeSums {
    /// Bytes of the fluctuations of so many fields, and of their modes.
    pub fn bytes(places: usize, fields: usize) -> f64 {
        12.0 * (places * fields) as f64 + 24.0 * (fields * fields) as f64
    }

    /// Adds the fluctuations of a field about `mean`. Panics if their layouts differ.
    pub fn add(&mut self, field: &Field, mean: &Field) {
        assert_eq!(field.len(), mean.len(), "vectors of the field and of the mean");
        let one = |i: usize| {
            let has_data = field.flag[i] != NO_DATA && mean.flag[i] != NO_DATA;
            let fluctuation = field.displacement_mm(i) - mean.displacement_mm(i);
            if has_data { fluctuation.as_vec3().to_array() } else { [0.0; 3] }
        };
        self.fluctuations.push((0..field.len()).flat_map(one).collect());
    }

    /// The `most` strongest modes: their numbers, and a field of each, mm, at the places of `mean`.
    pub fn finish(self, mean: &Field, most: usize) -> (ModeStatistics, Vec<Field>) {
        let count = self.fluctuations.len();
        let places = mean.flag.iter().filter(|flag| **flag != NO_DATA).count() as f64;
        let product = |i: usize, j: usize| {
            let pairs = self.fluctuations[i].iter().zip(&self.fluctuations[j]);
            pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>() / (places * count as f64)
        };
        let mut matrix = DMatrix::zeros(count, count);
        for i in 0..count {
            for j in 0..=i {
                let value = product(i, j);
                (matrix[(i, j)], matrix[(j, i)]) = (value, value);
            }
        }
        let total = matrix.trace();
        let eigen = SymmetricEigen::new(matrix);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]).then(a.cmp(b)));
        order.truncate(most);
        // The sign of an eigenvector is free: its largest entry is positive.
        let vector = |mode: usize| -> Vec<f64> {
            let column: Vec<f64> = eigen.eigenvectors.column(mode).iter().copied().collect();
            let largest = column.iter().copied().fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
            column.iter().map(|entry| entry * largest.signum()).collect()
        };
        let vectors: Vec<Vec<f64>> = order.iter().map(|mode| vector(*mode)).collect();
        let values: Vec<f64> = order.iter().map(|mode| eigen.eigenvalues[*mode].max(0.0)).collect();
        let root = (count as f64).sqrt();
        let statistics = ModeStatistics {
            share: values.iter().map(|value| value / total).collect(),
            rms_mm: values.iter().map(|value| value.sqrt()).collect(),
            amount: vectors.iter().map(|vector| vector.iter().map(|entry| root * entry).collect()).collect(),
        };
        (statistics, vectors.iter().map(|vector| self.mode(mean, vector)).collect())
    }

    fn mode(&self, mean: &Field, vector: &[f64]) -> Field {
        let mut mode = Field::empty(mean.layout.clone());
        let root = (vector.len() as f64).sqrt();
        for i in (0..mean.len()).filter(|i| mean.flag[*i] != NO_DATA) {
            let sum = |c: usize| {
                let fields = self.fluctuations.iter().zip(vector);
                fields.map(|(field, entry)| entry * f64::from(field[3 * i + c])).sum::<f64>()
            };
            [mode.u[i], mode.v[i], mode.w[i]] = [0, 1, 2].map(|c| (sum(c) / root) as f32);
            mode.flag[i] = MEASURED;
        }
        mode
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures::field;
    use std::f64::consts::TAU;

    #[test]
    fn two_motions_come_apart_with_their_energies() {
        let shape = [10, 9, 8];
        let mean = field(shape, |_| [0.3, 0.0, 0.1]);
        let [strong, weak] = [field(shape, |[x, ..]| [0.0, x.sin(), 0.0]), field(shape, |[.., z]| [0.0, 0.0, z.cos()])];
        let mut sums = ModeSums::default();
        for n in 0..12 {
            let (sin, cos) = (TAU * f64::from(n) / 12.0).sin_cos();
            let mut one = mean.clone();
            for i in 0..one.len() {
                one.v[i] += (0.05 * sin) as f32 * strong.v[i];
                one.w[i] += (0.01 * cos) as f32 * weak.w[i];
            }
            sums.add(&one, &mean);
        }
        let (found, fields) = sums.finish(&mean, 3);
        let square = |values: &[f32], size: f64| {
            let sum: f64 = values.iter().map(|value| f64::from(*value).powi(2)).sum();
            0.5 * size * size * sum / values.len() as f64
        };
        let [one, two] = [square(&strong.v, 0.05), square(&weak.w, 0.01)];
        assert!((found.rms_mm[0] / one.sqrt() - 1.0).abs() < 1e-4 && (found.rms_mm[1] / two.sqrt() - 1.0).abs() < 1e-3);
        assert!((found.share[0] - one / (one + two)).abs() < 1e-4 && found.share[2] < 1e-6, "{found:?}");
        for mode in 0..2 {
            let square: f64 = found.amount[mode].iter().map(|amount| amount * amount).sum();
            assert!((square / 12.0 - 1.0).abs() < 1e-9);
        }
        // The amounts and the modes give the fields back.
        let (n, i) = (2, 345);
        let back: f64 = (0..2).map(|mode| found.amount[mode][n] * f64::from(fields[mode].v[i])).sum();
        let wanted = 0.05 * (TAU * 2.0 / 12.0).sin() * f64::from(strong.v[i]);
        assert!((back - wanted).abs() < 1e-6, "{back} for {wanted}");
    }
}
