//! The fit of the mean cell: least squares of a smooth periodic surface through the pixels of many lenslets. With
//! T(-s) = T(s) imposed, the symmetry determines where the centre is.

use super::mean_cell::{MeanCell, knots_of, splines, wrapped};
use glam::{DMat2, DVec2};

/// Knots per pixel of the fitted surface, and the smallest and largest number along a side. More would follow a sharp
/// rim better. But at a pitch near a whole number of pixels all discs are sampled at the same places, and then the
/// images would not determine the centre.
const KNOTS_PER_PX: f64 = 1.0;
const KNOTS: [usize; 2] = [8, 32];
/// Weight of the surface's roughness against its misfit. It only determines the surface where no pixel falls.
const ROUGHNESS: f64 = 1e-4;

/// Weights of the five-point Laplacian applied twice, by the squared distance from a knot: 0, 1, 2 and 4.
const LAPLACIAN_SQUARED: [f64; 5] = [20.0, -8.0, 2.0, 0.0, 1.0];

/// Normal equations of the surface, summed over pixels.
pub(crate) struct CellEquations {
    knots: [usize; 2],
    /// For each knot, the products with the 7 x 7 knots around it.
    normal: Vec<[f64; 49]>,
    right: Vec<f64>,
}

impl CellEquations {
    pub fn new(basis_px: DMat2) -> Self {
        let knots = knots_of(basis_px, KNOTS_PER_PX, KNOTS);
        let count = knots[0] * knots[1];
        Self { knots, normal: vec![[0.0; 49]; count], right: vec![0.0; count] }
    }

    /// Adds a pixel whose centre is at `place` in the cell.
    #[inline]
    pub fn add(&mut self, place: DVec2, value: f64) {
        let (first_x, weight_x, _) = splines(place.x * self.knots[0] as f64);
        let (first_y, weight_y, _) = splines(place.y * self.knots[1] as f64);
        let columns = wrapped(first_x, self.knots[0]);
        let rows = wrapped(first_y, self.knots[1]);
        for b in 0..4 {
            for a in 0..4 {
                let weight = weight_y[b] * weight_x[a];
                let knot = rows[b] * self.knots[0] + columns[a];
                self.right[knot] += weight * value;
                let stencil = &mut self.normal[knot];
                for d in 0..4 {
                    for c in 0..4 {
                        stencil[(3 + d - b) * 7 + 3 + c - a] += weight * weight_y[d] * weight_x[c];
                    }
                }
            }
        }
    }

    pub fn merge(&mut self, other: &Self) {
        self.right.iter_mut().zip(&other.right).for_each(|(mine, theirs)| *mine += theirs);
        for (mine, theirs) in self.normal.iter_mut().zip(&other.normal) {
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| *mine += theirs);
        }
    }

    /// The surface. With `is_symmetric`, as if every pixel had also been added at -s.
    pub fn solve(mut self, is_symmetric: bool) -> MeanCell {
        if is_symmetric {
            self.reflect();
        }
        let mean: f64 = self.normal.iter().map(|stencil| stencil[24]).sum::<f64>() / self.right.len() as f64;
        let rough = ROUGHNESS * mean.max(f64::MIN_POSITIVE);
        for n in 0..49usize {
            let away = (n % 7).abs_diff(3).pow(2) + (n / 7).abs_diff(3).pow(2);
            let weight = rough * LAPLACIAN_SQUARED.get(away).unwrap_or(&0.0);
            self.normal.iter_mut().for_each(|stencil| stencil[n] += weight);
        }
        MeanCell { knots: self.knots, coefficients: self.conjugate_gradients() }
    }

    fn reflect(&mut self) {
        let [columns, rows] = self.knots;
        let opposite = |knot: usize| {
            let (row, column) = (knot / columns, knot % columns);
            (rows - row) % rows * columns + (columns - column) % columns
        };
        self.right = (0..self.right.len()).map(|knot| self.right[knot] + self.right[opposite(knot)]).collect();
        self.normal = (0..self.normal.len())
            .map(|knot| std::array::from_fn(|step| self.normal[knot][step] + self.normal[opposite(knot)][48 - step]))
            .collect();
    }

    /// The product of the normal matrix and the coefficients `c`.
    fn apply(&self, c: &[f64]) -> Vec<f64> {
        let [columns, rows] = self.knots;
        let about = |knot: usize, knots: usize| std::array::from_fn::<usize, 7, _>(|n| (knot + knots + n - 3) % knots);
        let across: Vec<[usize; 7]> = (0..columns).map(|column| about(column, columns)).collect();
        let mut image = Vec::with_capacity(c.len());
        for (row, stencils) in self.normal.chunks(columns).enumerate() {
            let lines = about(row, rows).map(|row| &c[row * columns..(row + 1) * columns]);
            for (stencil, across) in stencils.iter().zip(&across) {
                let pairs = stencil.chunks(7).zip(lines);
                let line = |(stencil, line): (&[f64], &[f64])| -> f64 {
                    stencil.iter().zip(across).map(|(product, column)| product * line[*column]).sum()
                };
                image.push(pairs.map(line).sum());
            }
        }
        image
    }

    /// Conjugate gradients from zero, until the residual is 1e-10 of the right side.
    fn conjugate_gradients(&self) -> Vec<f64> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut solution = vec![0.0; self.right.len()];
        let mut residual = self.right.clone();
        let mut direction = residual.clone();
        let mut power = dot(&residual, &residual);
        let enough = power * 1e-20;
        for _ in 0..2000 {
            if power <= enough {
                break;
            }
            let image = self.apply(&direction);
            let step = power / dot(&direction, &image);
            solution.iter_mut().zip(&direction).for_each(|(solution, direction)| *solution += step * direction);
            residual.iter_mut().zip(&image).for_each(|(residual, image)| *residual -= step * image);
            let next = dot(&residual, &residual);
            direction
                .iter_mut()
                .zip(&residual)
                .for_each(|(direction, residual)| *direction = residual + next / power * *direction);
            power = next;
        }
        solution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_of_a_smooth_symmetric_cell_give_it_back() {
        let truth = |s: DVec2| (std::f64::consts::TAU * s.x).cos() + 0.5 * (std::f64::consts::TAU * (s.x - s.y)).cos();
        let mut fold = CellEquations::new(DMat2::from_diagonal(DVec2::splat(14.0)));
        for n in 0..20_000 {
            let place = DVec2::new(n as f64 * 0.618_034, n as f64 * 0.414_214);
            fold.add(place, truth(place));
        }
        let cell = fold.solve(true);
        for n in 0..100 {
            let place = DVec2::new(n as f64 * 0.37, n as f64 * 0.11);
            assert!((cell.at(place).0 - truth(place)).abs() < 3e-3);
            assert!((cell.at(place).0 - cell.at(-place).0).abs() < 1e-9);
        }
    }
}
