//! The mean image of one lenslet's cell: a smooth periodic surface.
//!
//! The surface T(s) is defined on the cell, s = B^-1 (x - c) in [0, 1)^2, with the centre c of the lenslet image and
//! the lattice basis B. T(s) is what a *pixel* at s sees, integrated over its square. A fit of pixels to T is free of
//! the bias that cut pixels and neighbouring discs give a centroid. T is a cubic B-spline with knots at s = k / K.

use glam::{DMat2, DVec2};

/// Knots per pixel of the cell that lenslets are read against, and their fewest and most along a side.
pub(crate) const TABLE_PER_PX: f64 = 4.0;
pub(crate) const TABLE: [usize; 2] = [16, 160];

pub(crate) struct MeanCell {
    pub knots: [usize; 2],
    /// Row by row.
    pub coefficients: Vec<f64>,
}

/// The four cubic B-splines that are not zero at `t`: the number of the first, their values and their slopes.
#[inline]
pub(crate) fn splines(t: f64) -> (i64, [f64; 4], [f64; 4]) {
    // `floor` would be a function call without SSE 4.1.
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

/// Four consecutive knots from `first`, wrapped around.
#[inline]
pub(crate) fn wrapped(first: i64, knots: usize) -> [usize; 4] {
    let start = first.rem_euclid(knots as i64) as usize;
    [0, 1, 2, 3].map(|step| if start + step < knots { start + step } else { start + step - knots })
}

/// Number of knots along the sides of a cell, `per_px` of them per pixel.
pub(crate) fn knots_of(basis_px: DMat2, per_px: f64, [fewest, most]: [usize; 2]) -> [usize; 2] {
    [basis_px.x_axis, basis_px.y_axis].map(|side| ((side.length() * per_px).round() as usize).clamp(fewest, most))
}

impl MeanCell {
    /// Position of a knot, each coordinate in [-1/2, 1/2).
    pub fn place(knots: [usize; 2], knot: usize) -> DVec2 {
        let wrapped = |n: usize, knots: usize| n as f64 / knots as f64 - if 2 * n >= knots { 1.0 } else { 0.0 };
        DVec2::new(wrapped(knot % knots[0], knots[0]), wrapped(knot / knots[0], knots[1]))
    }

    pub fn through(knots: [usize; 2], values: &[f64]) -> Self {
        // Coefficients of the inverse of (1, 4, 1) / 6: sqrt(3) z^|n|, z = sqrt(3) - 2. After 21 steps they are below
        // 1e-12.
        let pole = 3f64.sqrt() - 2.0;
        let weights: Vec<f64> = (-21i32..=21).map(|n| 3f64.sqrt() * pole.powi(n.abs())).collect();
        let [columns, rows] = knots;
        let along = |values: &[f64], step: &dyn Fn(usize, usize) -> usize| -> Vec<f64> {
            (0..values.len())
                .map(|knot| weights.iter().enumerate().map(|(shift, weight)| weight * values[step(knot, shift)]).sum())
                .collect()
        };
        // Adding 21 times the side is a whole number of turns and keeps the indices positive.
        let lines = along(values, &|knot, shift| {
            knot / columns * columns + (knot % columns + 21 * columns + shift - 21) % columns
        });
        let coefficients =
            along(&lines, &|knot, shift| (knot / columns + 21 * rows + shift - 21) % rows * columns + knot % columns);
        Self { knots, coefficients }
    }

    /// Value and slope (per unit of s) at a position in the cell.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_passes_through_its_values_and_its_slope_is_its_own() {
        for knots in [[16, 16], [19, 40]] {
            let values: Vec<f64> = (0..knots[0] * knots[1]).map(|n| ((n * 37) % 101) as f64).collect();
            let cell = MeanCell::through(knots, &values);
            for (knot, value) in values.iter().enumerate() {
                assert!((cell.at(MeanCell::place(knots, knot)).0 - value).abs() < 1e-9);
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
}
