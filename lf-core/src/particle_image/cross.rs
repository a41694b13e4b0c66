//! A product of two functions, one along each axis, as cubic B-splines.

use super::spline::{cubic, solve};
use super::table::Table;

/// A function along one axis, linear in the size.
#[derive(Debug, Clone)]
pub(super) struct Line {
    low: f64,
    per_step: f64,
    values: Vec<f64>,
    by_size: Vec<f64>,
}

/// A function along x times one along y.
#[derive(Debug, Clone)]
pub(super) struct Cross([Line; 2]);

/// One of them at a place: value, slope, derivative by the size.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Read {
    is_below: bool,
    pub(super) value: f64,
    pub(super) slope: f64,
    pub(super) by_size: f64,
}

impl Line {
    /// Through `values` and `by_size` (its derivative by the size) at nodes `step` apart from `low` on.
    pub(super) fn new(low: f64, step: f64, mut values: Vec<f64>, mut by_size: Vec<f64>) -> Self {
        for table in [&mut values, &mut by_size] {
            let count = table.len();
            solve(table, 1, count);
        }
        Self { low, per_step: 1.0 / step, values, by_size }
    }
}

impl Cross {
    /// The product of a function along x and one along y.
    pub(super) fn new(lines: [Line; 2]) -> Self {
        Self(lines)
    }
}

impl Table for Cross {
    type Taps = Read;

    #[inline(always)]
    fn taps(&self, axis: usize, x: f64, more: f64) -> Read {
        let line = &self.0[axis];
        let (is_below, first, weights, slopes) =
            cubic((x - line.low) * line.per_step, line.per_step, line.values.len());
        let dot = |a: &[f64; 4], b: &[f64]| (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]);
        let (values, by_size) = (&line.values[first..first + 4], &line.by_size[first..first + 4]);
        let size = dot(&weights, by_size);
        Read {
            is_below,
            value: dot(&weights, values) + more * size,
            slope: dot(&slopes, values) + more * dot(&slopes, by_size),
            by_size: size,
        }
    }

    #[inline(always)]
    fn is_below(taps: &Read) -> bool {
        taps.is_below
    }

    #[inline(always)]
    fn at<const N: usize>(&self, x: &Read, y: &Read, _: f64) -> [f64; 4] {
        let by_size = if N > 4 { x.by_size * y.value + x.value * y.by_size } else { 0.0 };
        [x.value * y.value, x.slope * y.value, x.value * y.slope, by_size]
    }

    fn bytes(&self) -> usize {
        self.0.iter().map(|line| size_of_val(&line.values[..]) + size_of_val(&line.by_size[..])).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_comes_back_with_its_slopes() {
        let step = 0.1;
        let line = |f: fn(f64) -> f64| {
            let table = |scale: f64| (0..60).map(|n| scale * f(-3.0 + n as f64 * step)).collect();
            Line::new(-3.0, step, table(1.0), table(0.25))
        };
        let cross = Cross::new([line(f64::sin), line(f64::cos)]);
        for (x, y, more) in [(0.33, 0.71, 0.0), (-1.04, 1.2, 0.1), (1.5, -1.57, -0.2)] {
            let got = cross.at::<8>(&cross.taps(0, x, more), &cross.taps(1, y, more), more);
            let scale: f64 = 1.0 + 0.25 * more;
            let by_size = 0.5 * scale * x.sin() * y.cos();
            let square = scale * scale;
            let wanted = [square * x.sin() * y.cos(), square * x.cos() * y.cos(), -square * x.sin() * y.sin(), by_size];
            for (got, wanted) in got.iter().zip(wanted) {
                assert!((got - wanted).abs() < 3e-5, "{got} for {wanted}");
            }
        }
        assert!(Cross::is_below(&cross.taps(0, -9.0, 0.0)) && !Cross::is_below(&cross.taps(1, 9.0, 0.0)));
    }
}
