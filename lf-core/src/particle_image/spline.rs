//! A function of the plane and of a size, as a cubic B-spline: smooth, with exact derivatives of what it gives.

use super::table::Table;
use glam::Vec4;

/// The function on a square lattice of nodes, linear in the size.
#[derive(Debug, Clone)]
pub(super) struct Spline {
    low: [f64; 2],
    per_step: f64,
    /// Nodes along x and y.
    nodes: [usize; 2],
    values: Vec<f64>,
    by_size: Vec<f64>,
    /// Both in single precision; empty unless [`Self::quick`] made them.
    quick: [Vec<f32>; 2],
}

/// The four nodes about a coordinate and their weights: for the value, and for the slope.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Taps {
    /// Whether the coordinate lies before the first node.
    is_below: bool,
    first: usize,
    weights: [f64; 4],
    slopes: [f64; 4],
}

impl Spline {
    /// Through `values` and `by_size` (its derivative by the size), row by row, at nodes `step` apart from `low` on.
    pub(super) fn new(
        low: [f64; 2],
        step: f64,
        nodes: [usize; 2],
        mut values: Vec<f64>,
        mut by_size: Vec<f64>,
    ) -> Self {
        [&mut values, &mut by_size].into_iter().for_each(|table| to_coefficients(table, nodes));
        Self { low, per_step: 1.0 / step, nodes, values, by_size, quick: Default::default() }
    }
}

/// Where a coordinate lies among `count` nodes of a cubic B-spline: whether before the first, the first of four nodes
/// about it, and their weights for the value and for the slope. `place` counts nodes. Beyond the nodes the function is
/// constant.
#[inline(always)]
pub(super) fn cubic(place: f64, per_step: f64, count: usize) -> (bool, usize, [f64; 4], [f64; 4]) {
    let held = place.clamp(1.0, (count - 2) as f64 - 1e-9);
    let inside = if held == place { per_step } else { 0.0 };
    let whole = held as usize;
    let t = held - whole as f64;
    let s = 1.0 - t;
    let weights = [
        s * s * s / 6.0,
        (3.0 * t * t * (t - 2.0) + 4.0) / 6.0,
        (3.0 * s * s * (s - 2.0) + 4.0) / 6.0,
        t * t * t / 6.0,
    ];
    let slopes = [-0.5 * s * s, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t * t];
    (place < 1.0, whole - 1, weights, slopes.map(|slope| slope * inside))
}

/// Weights of the four nodes about a place: for the value, the slope and the curvature.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stencil {
    pub(super) first: usize,
    pub(super) weights: [[f64; 4]; 3],
}

impl Stencil {
    /// Along an axis with `count` nodes; `place` counts nodes.
    #[inline(always)]
    pub(super) fn new(place: f64, per_step: f64, count: usize) -> Self {
        let (_, first, weights, slopes) = cubic(place, per_step, count);
        let held = place.clamp(1.0, (count - 2) as f64 - 1e-9);
        let t = held - held.floor();
        let inside = if held == place { per_step * per_step } else { 0.0 };
        let curves = [1.0 - t, 3.0 * t - 2.0, 1.0 - 3.0 * t, t].map(|curve| curve * inside);
        Self { first, weights: [weights, slopes, curves] }
    }
}

/// The first of four nodes about a place, and their weights for value, slope and curvature, in single precision.
#[inline(always)]
pub(super) fn quick_stencil(place: f32, last: f32) -> (usize, [f32; 4], [f32; 4], [f32; 4]) {
    let held = place.max(1.0).min(last);
    let whole = held as usize;
    let t = held - whole as f32;
    let s = 1.0 - t;
    let level = [
        s * s * s * (1.0 / 6.0),
        0.5 * t * t * (t - 2.0) + 2.0 / 3.0,
        0.5 * s * s * (s - 2.0) + 2.0 / 3.0,
        t * t * t * (1.0 / 6.0),
    ];
    let slope = [-0.5 * s * s, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t * t];
    (whole - 1, level, slope, [s, 3.0 * t - 2.0, 1.0 - 3.0 * t, t])
}

impl Spline {
    /// With what [`Self::fill`] reads.
    pub(super) fn quick(mut self) -> Self {
        self.quick = [&self.values, &self.by_size].map(|table| table.iter().map(|value| *value as f32).collect());
        self
    }

    /// Fills level, slopes along x and y, and curvatures xx, xy and yy at places, in single precision, for a size that
    /// is `more` than the table's.
    #[inline(always)]
    pub(super) fn fill(&self, ([x, y], more): (&[Vec<f32>; 2], f32), count: usize, means: &mut [Vec<f32>; 6]) {
        let per_step = self.per_step as f32;
        let [a, b, c, d, e, f] = means.each_mut().map(|list| &mut list[..count]);
        let weights =
            |x: f32, axis: usize| quick_stencil((x - self.low[axis] as f32) * per_step, (self.nodes[axis] - 3) as f32);
        let square = per_step * per_step;
        let scales = [1.0, per_step, per_step, square, square, square];
        for (n, (x, y)) in x[..count].iter().zip(&y[..count]).enumerate() {
            let (column, level_x, slope_x, curve_x) = weights(*x, 0);
            let (row, level_y, slope_y, curve_y) = weights(*y, 1);
            let (mut level, mut slope, mut curve) = (Vec4::ZERO, Vec4::ZERO, Vec4::ZERO);
            for j in 0..4 {
                let start = (row + j) * self.nodes[0] + column;
                let [nodes, by_size] = self.quick.each_ref().map(|table| Vec4::from_slice(&table[start..start + 4]));
                let nodes = nodes + more * by_size;
                level += level_y[j] * nodes;
                slope += slope_y[j] * nodes;
                curve += curve_y[j] * nodes;
            }
            let [level_x, slope_x, curve_x] = [level_x, slope_x, curve_x].map(Vec4::from_array);
            a[n] = scales[0] * level.dot(level_x);
            b[n] = scales[1] * level.dot(slope_x);
            c[n] = scales[2] * slope.dot(level_x);
            d[n] = scales[3] * level.dot(curve_x);
            e[n] = scales[4] * slope.dot(slope_x);
            f[n] = scales[5] * curve.dot(level_x);
        }
    }
}

impl Table for Spline {
    type Taps = Taps;

    #[inline(always)]
    fn taps(&self, axis: usize, x: f64, _: f64) -> Taps {
        let place = (x - self.low[axis]) * self.per_step;
        let (is_below, first, weights, slopes) = cubic(place, self.per_step, self.nodes[axis]);
        Taps { is_below, first, weights, slopes }
    }

    #[inline(always)]
    fn is_below(taps: &Taps) -> bool {
        taps.is_below
    }

    #[inline(always)]
    fn at<const N: usize>(&self, x: &Taps, y: &Taps, more: f64) -> [f64; 4] {
        let (mut level, mut slope, mut size) = ([0.0; 4], [0.0; 4], [0.0; 4]);
        for n in 0..4 {
            let start = y.first * self.nodes[0] + x.first + n * self.nodes[0];
            let (values, by_size) = (&self.values[start..start + 4], &self.by_size[start..start + 4]);
            for k in 0..4 {
                let value = values[k] + more * by_size[k];
                level[k] += y.weights[n] * value;
                if N > 1 {
                    slope[k] += y.slopes[n] * value;
                }
                if N > 4 {
                    size[k] += y.weights[n] * by_size[k];
                }
            }
        }
        let dot = |a: [f64; 4], b: [f64; 4]| (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]);
        let by_size = if N > 4 { dot(size, x.weights) } else { 0.0 };
        if N <= 1 {
            return [dot(level, x.weights), 0.0, 0.0, 0.0];
        }
        [dot(level, x.weights), dot(level, x.slopes), dot(slope, x.weights), by_size]
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.values[..])
            + size_of_val(&self.by_size[..])
            + self.quick.iter().map(|table| size_of_val(&table[..])).sum::<usize>()
    }
}

/// From values to the coefficients of the B-spline through them, along both axes.
pub(super) fn to_coefficients(table: &mut [f64], [columns, rows]: [usize; 2]) {
    table.chunks_mut(columns).for_each(|row| solve(row, 1, columns));
    (0..columns).for_each(|column| solve(&mut table[column..], columns, rows));
}

/// Solves `c[i-1] + 4 c[i] + c[i+1] = 6 f[i]`, with `c = f` at both ends, in place.
pub(super) fn solve(line: &mut [f64], stride: usize, count: usize) {
    let mut factors = vec![0.0; count];
    for n in 1..count - 1 {
        let pivot = 1.0 / (4.0 - factors[n - 1]);
        factors[n] = pivot;
        line[n * stride] = (6.0 * line[n * stride] - line[(n - 1) * stride]) * pivot;
    }
    for n in (1..count - 1).rev() {
        line[n * stride] -= factors[n] * line[(n + 1) * stride];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_function_comes_back_with_its_slopes() {
        let (step, nodes) = (0.1, [60, 50]);
        let f = |x: f64, y: f64| (x * 0.9).sin() * (y * 1.1).cos();
        let at = |n: usize| (-3.0 + (n % 60) as f64 * step, -2.5 + (n / 60) as f64 * step);
        let table = |scale: f64| (0..3000).map(|n| scale * f(at(n).0, at(n).1)).collect();
        let spline = Spline::new([-3.0, -2.5], step, nodes, table(1.0), table(0.5));
        for (x, y, more) in [(0.33, 0.71, 0.0), (-1.04, 1.2, 0.1), (1.5, -1.57, -0.2)] {
            let got = spline.at::<8>(&spline.taps(0, x, more), &spline.taps(1, y, more), more);
            let scale = 1.0 + 0.5 * more;
            let by_x = 0.9 * (x * 0.9).cos() * (y * 1.1).cos() * scale;
            let by_y = -1.1 * (x * 0.9).sin() * (y * 1.1).sin() * scale;
            let wanted = [scale * f(x, y), by_x, by_y, 0.5 * f(x, y)];
            for (got, wanted) in got.iter().zip(wanted) {
                assert!((got - wanted).abs() < 3e-5, "{got} for {wanted}");
            }
        }
        // Constant beyond the nodes.
        let [value, by_x, ..] = spline.at::<8>(&spline.taps(0, 40.0, 0.0), &spline.taps(1, 0.3, 0.0), 0.0);
        assert!(value.is_finite() && by_x == 0.0);
    }
}
