//! The mean image of one lenslet's cell: a smooth periodic surface fitted to the pixels of many lenslets.
//!
//! The surface T(s) lives on the cell, s = B^-1 (x - c) in [0, 1)^2 with c the lenslet image's centre and B the lattice
//! basis, and holds what a *pixel* sees there: the light already integrated over the pixel's square. Fitting pixels with
//! it costs no centroid's bias from cut pixels or neighbouring discs. Cubic B-splines, knots at s = k / K, least squares
//! with T(-s) = T(s): the symmetry is what says where the centre is.

use glam::{DMat2, DVec2};

/// Knots per pixel of what is read against, and fewest and most of them along a side.
const TABLE_PER_PX: f64 = 4.0;
const TABLE: [usize; 2] = [16, 160];
/// Knots per pixel of what is fitted to pixels, and fewest and most of them along a side. Finer knots follow a sharp rim
/// better but leave the centre free where the pitch is near a whole number of pixels, for then all lenslets sample their
/// discs at the same places.
const KNOTS_PER_PX: f64 = 1.0;
const KNOTS: [usize; 2] = [8, 32];
/// Weight of the surface's roughness against its misfit: holds it where no pixel falls, and moves nothing else.
const ROUGHNESS: f64 = 1e-4;

/// The periodic surface.
#[derive(Debug, Clone)]
pub(crate) struct Cell {
    knots: [usize; 2],
    coefficients: Vec<f64>,
}

/// The four cubic B-splines that are not zero at `t`, the first one's knot, and their slopes.
#[inline]
fn splines(t: f64) -> (i64, [f64; 4], [f64; 4]) {
    // Rounding down by hand: without SSE 4.1 `floor` is a call.
    let towards_zero = t as i64;
    let floor = towards_zero - i64::from(t < towards_zero as f64);
    let f = t - floor as f64;
    let g = 1.0 - f;
    let value = [
        g * g * g / 6.0,
        (4.0 - 6.0 * f * f + 3.0 * f * f * f) / 6.0,
        (4.0 - 6.0 * g * g + 3.0 * g * g * g) / 6.0,
        f * f * f / 6.0,
    ];
    let slope = [-0.5 * g * g, (1.5 * f - 2.0) * f, (2.0 - 1.5 * g) * g, 0.5 * f * f];
    (floor - 1, value, slope)
}

/// Four knots in a row, from `first`, wrapped.
#[inline]
fn wrapped(first: i64, knots: usize) -> [usize; 4] {
    let start = first.rem_euclid(knots as i64) as usize;
    [0, 1, 2, 3].map(|step| if start + step < knots { start + step } else { start + step - knots })
}

/// Knots along the sides of a cell, `per_px` of them a pixel.
fn knots_of(basis_px: DMat2, per_px: f64, [fewest, most]: [usize; 2]) -> [usize; 2] {
    [basis_px.x_axis, basis_px.y_axis].map(|side| ((side.length() * per_px).round() as usize).clamp(fewest, most))
}

impl Cell {
    /// Knots along the sides of a cell that is read against.
    pub fn table_knots(basis_px: DMat2) -> [usize; 2] {
        knots_of(basis_px, TABLE_PER_PX, TABLE)
    }

    /// Place of a knot, each coordinate in [-1/2, 1/2).
    pub fn place(knots: [usize; 2], knot: usize) -> DVec2 {
        let wrapped = |n: usize, knots: usize| n as f64 / knots as f64 - if 2 * n >= knots { 1.0 } else { 0.0 };
        DVec2::new(wrapped(knot % knots[0], knots[0]), wrapped(knot / knots[0], knots[1]))
    }

    /// The surface through given values at its knots.
    pub fn through(knots: [usize; 2], values: &[f64]) -> Self {
        // The inverse of the spline's (1, 4, 1) / 6: sqrt 3 z^|n| with z = sqrt 3 - 2, 1e-12 after 21 steps.
        let pole = 3f64.sqrt() - 2.0;
        let taps: Vec<f64> = (-21i32..=21).map(|n| 3f64.sqrt() * pole.powi(n.abs())).collect();
        let [columns, rows] = knots;
        let along = |values: &[f64], step: &dyn Fn(usize, usize) -> usize| -> Vec<f64> {
            (0..values.len())
                .map(|knot| taps.iter().enumerate().map(|(tap, weight)| weight * values[step(knot, tap)]).sum())
                .collect()
        };
        // 21 times the side is a whole number of turns, and keeps the places positive.
        let lines =
            along(values, &|knot, tap| knot / columns * columns + (knot % columns + 21 * columns + tap - 21) % columns);
        let coefficients =
            along(&lines, &|knot, tap| (knot / columns + 21 * rows + tap - 21) % rows * columns + knot % columns);
        Self { knots, coefficients }
    }

    /// Value and slope (per unit of s) at a place of the cell.
    #[inline]
    pub fn at(&self, place: DVec2) -> (f64, DVec2) {
        let (first_x, value_x, slope_x) = splines(place.x * self.knots[0] as f64);
        let (first_y, value_y, slope_y) = splines(place.y * self.knots[1] as f64);
        let columns = wrapped(first_x, self.knots[0]);
        let rows = wrapped(first_y, self.knots[1]);
        let (mut value, mut slope) = (0.0, DVec2::ZERO);
        for b in 0..4 {
            let row = &self.coefficients[rows[b] * self.knots[0]..(rows[b] + 1) * self.knots[0]];
            let (mut line, mut along) = (0.0, 0.0);
            for a in 0..4 {
                line += value_x[a] * row[columns[a]];
                along += slope_x[a] * row[columns[a]];
            }
            value += value_y[b] * line;
            slope += DVec2::new(value_y[b] * along, slope_y[b] * line);
        }
        (value, slope * DVec2::new(self.knots[0] as f64, self.knots[1] as f64))
    }
}

/// Normal equations of the surface, summed over pixels.
#[derive(Debug, Clone)]
pub(crate) struct Fold {
    knots: [usize; 2],
    /// For each knot, the products with the 7 x 7 knots around it.
    normal: Vec<[f64; 49]>,
    right: Vec<f64>,
}

impl Fold {
    /// Empty equations for a cell with these sides.
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

    /// Adds another sum.
    pub fn merge(&mut self, other: &Self) {
        self.right.iter_mut().zip(&other.right).for_each(|(mine, theirs)| *mine += theirs);
        for (mine, theirs) in self.normal.iter_mut().zip(&other.normal) {
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| *mine += theirs);
        }
    }

    /// The surface; symmetric about the cell's origin if asked, as if every pixel had been added at -s too.
    pub fn solve(mut self, symmetric: bool) -> Cell {
        if symmetric {
            self.reflect();
        }
        let mean: f64 = self.normal.iter().map(|stencil| stencil[24]).sum::<f64>() / self.right.len() as f64;
        let rough = ROUGHNESS * mean.max(f64::MIN_POSITIVE);
        let coefficients = self.conjugate_gradients(rough);
        Cell { knots: self.knots, coefficients }
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

    /// (A + rough L'L) c, with L the five-point Laplacian of the coefficients.
    fn apply(&self, rough: f64, c: &[f64]) -> Vec<f64> {
        let [columns, rows] = self.knots;
        let bent = self.laplacian(&self.laplacian(c));
        (0..c.len())
            .map(|knot| {
                let (row, column) = (knot / columns, knot % columns);
                let mut sum = rough * bent[knot];
                for d in 0..7 {
                    let line = (row + rows + d - 3) % rows * columns;
                    for a in 0..7 {
                        sum += self.normal[knot][d * 7 + a] * c[line + (column + columns + a - 3) % columns];
                    }
                }
                sum
            })
            .collect()
    }

    fn laplacian(&self, c: &[f64]) -> Vec<f64> {
        let [columns, rows] = self.knots;
        (0..c.len())
            .map(|knot| {
                let (row, column) = (knot / columns, knot % columns);
                let beside =
                    c[row * columns + (column + 1) % columns] + c[row * columns + (column + columns - 1) % columns];
                let above = c[(row + 1) % rows * columns + column] + c[(row + rows - 1) % rows * columns + column];
                4.0 * c[knot] - beside - above
            })
            .collect()
    }

    /// Conjugate gradients from zero, to 1e-10 of the right side.
    fn conjugate_gradients(&self, rough: f64) -> Vec<f64> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut solution = vec![0.0; self.right.len()];
        let mut rest = self.right.clone();
        let mut direction = rest.clone();
        let mut power = dot(&rest, &rest);
        let enough = power * 1e-20;
        for _ in 0..2000 {
            if power <= enough {
                break;
            }
            let image = self.apply(rough, &direction);
            let step = power / dot(&direction, &image);
            solution.iter_mut().zip(&direction).for_each(|(solution, direction)| *solution += step * direction);
            rest.iter_mut().zip(&image).for_each(|(rest, image)| *rest -= step * image);
            let next = dot(&rest, &rest);
            direction.iter_mut().zip(&rest).for_each(|(direction, rest)| *direction = rest + next / power * *direction);
            power = next;
        }
        solution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_passes_through_its_values_and_its_slope_is_its_own() {
        for knots in [[16, 16], [19, 40]] {
            let values: Vec<f64> = (0..knots[0] * knots[1]).map(|n| ((n * 37) % 101) as f64).collect();
            let cell = Cell::through(knots, &values);
            for (knot, value) in values.iter().enumerate() {
                assert!((cell.at(Cell::place(knots, knot)).0 - value).abs() < 1e-9);
            }
            for place in [DVec2::new(0.123, -0.4), DVec2::new(2.71, 1.01)] {
                let step = 1e-6;
                let along =
                    |axis: DVec2| (cell.at(place + step * axis).0 - cell.at(place - step * axis).0) / (2.0 * step);
                let slope = cell.at(place).1;
                assert!(slope.distance(DVec2::new(along(DVec2::X), along(DVec2::Y))) < 1e-5 * slope.length());
            }
        }
    }

    #[test]
    fn pixels_of_a_smooth_symmetric_cell_give_it_back() {
        let truth = |s: DVec2| (std::f64::consts::TAU * s.x).cos() + 0.5 * (std::f64::consts::TAU * (s.x - s.y)).cos();
        let mut fold = Fold::new(DMat2::from_diagonal(DVec2::splat(14.0)));
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
