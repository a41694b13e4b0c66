//! A function of the plane and of a size, as a cubic B-spline: smooth, with exact derivatives of what it gives.

use super::table::Table;

/// The function on a square lattice of nodes, linear in the size.
#[derive(Debug, Clone)]
pub(super) struct Spline {
    low: [f64; 2],
    per_step: f64,
    /// Nodes along x and y.
    nodes: [usize; 2],
    values: Vec<f64>,
    by_size: Vec<f64>,
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
        Self { low, per_step: 1.0 / step, nodes, values, by_size }
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

impl Spline {
    /// The stencil of a place along an axis.
    #[inline(always)]
    pub(super) fn stencil(&self, axis: usize, x: f64) -> Stencil {
        Stencil::new((x - self.low[axis]) * self.per_step, self.per_step, self.nodes[axis])
    }

    /// All numbers of a jet; the derivatives of slopes and curvatures by the size are 0 unless N asks for them.
    #[inline(always)]
    pub(super) fn jet<const N: usize>(&self, x: &Stencil, y: &Stencil, more: f64) -> Jet {
        let mut rows = [[0.0; 4]; 3];
        let mut sizes = [[0.0; 4]; 3];
        let orders = if N > 4 { 3 } else { 1 };
        for n in 0..4 {
            let start = (y.first + n) * self.nodes[0] + x.first;
            let (values, by_size) = (&self.values[start..start + 4], &self.by_size[start..start + 4]);
            for k in 0..4 {
                let value = values[k] + more * by_size[k];
                for order in 0..3 {
                    rows[order][k] += y.weights[order][n] * value;
                }
                for order in 0..orders {
                    sizes[order][k] += y.weights[order][n] * by_size[k];
                }
            }
        }
        let dot = |a: &[f64; 4], b: &[f64; 4]| (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]);
        let [level, slope, curve] = &x.weights;
        let of = |rows: &[[f64; 4]; 3]| {
            [
                dot(&rows[0], slope),
                dot(&rows[1], level),
                dot(&rows[0], curve),
                dot(&rows[1], slope),
                dot(&rows[2], level),
            ]
        };
        let [x, y, xx, xy, yy] = of(&rows);
        let [x_by, y_by, xx_by, xy_by, yy_by] = if N > 4 { of(&sizes) } else { [0.0; 5] };
        [dot(&rows[0], level), x, y, xx, xy, yy, dot(&sizes[0], level), x_by, y_by, xx_by, xy_by, yy_by]
    }
}

/// Value; slopes x and y; curvatures xx, xy and yy; the derivatives of all these by the size in the same order.
pub(super) type Jet = [f64; 12];

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
        size_of_val(&self.values[..]) + size_of_val(&self.by_size[..])
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
