//! The autocorrelation of an image and its peaks.

use super::basis::{reduced, shortest};
use crate::fit::polynomial::outer;
use glam::{DMat2, DVec2};
use lf_core::fourier::smooth_size;
use ndarray::{Array2, ArrayView2, s};
use rayon::prelude::*;
use rustfft::{FftDirection, FftPlanner, num_complex::Complex};

/// Shortest shift that counts as a lattice vector, px.
const SHORTEST_PX: f64 = 3.0;
/// Longest shift, as a share of the tile's side.
const REACH: f64 = 0.6;

/// Correlation coefficient at every shift up to `reach`. Rows and columns start at `-reach`.
pub(crate) struct Autocorrelation {
    value: Array2<f64>,
    reach: [i64; 2],
    /// Columns and rows of a tile, and the number of tiles.
    tile: [f64; 2],
    tiles: f64,
}

/// Power spectrum of a tile minus its best plane, of unit variance, and its deviation over its mean. None if flat.
fn power(tile: ArrayView2<f32>, padded: [usize; 2]) -> Option<(Vec<f64>, f64)> {
    let (rows, columns) = tile.dim();
    let count = (rows * columns) as f64;
    let (centre_x, centre_y) = (0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0));
    let (mut sum, mut along, mut down) = (0.0, 0.0, 0.0);
    for ((row, column), &value) in tile.indexed_iter() {
        sum += value as f64;
        along += value as f64 * (column as f64 - centre_x);
        down += value as f64 * (row as f64 - centre_y);
    }
    let mean = sum / count;
    let spread = |side: usize| count * ((side * side) as f64 - 1.0).max(1.0) / 12.0;
    let (slope_x, slope_y) = (along / spread(columns), down / spread(rows));
    let mut field = vec![Complex::new(0.0, 0.0); padded[0] * padded[1]];
    let mut squares = 0.0;
    for ((row, column), &value) in tile.indexed_iter() {
        let plane = mean + slope_x * (column as f64 - centre_x) + slope_y * (row as f64 - centre_y);
        let residual = value as f64 - plane;
        squares += residual * residual;
        field[row * padded[0] + column].re = residual;
    }
    let variance = squares / count;
    if mean <= 0.0 || variance.sqrt() < 1e-9 * mean {
        return None;
    }
    transform(&mut field, padded, FftDirection::Forward);
    Some((field.iter().map(|value| value.norm_sqr() / variance).collect(), variance.sqrt() / mean))
}

/// Fourier transform in two dimensions, in place and not scaled: rows, then columns.
fn transform(field: &mut Vec<Complex<f64>>, [columns, rows]: [usize; 2], direction: FftDirection) {
    let mut planner = FftPlanner::new();
    for length in [columns, rows] {
        let fft = planner.plan_fft(length, direction);
        field.par_chunks_mut(length).for_each(|line| fft.process(line));
        // Each pass ends with a transposition, so the second pass restores the order.
        let lines = field.len() / length;
        let turned: Vec<Complex<f64>> =
            (0..field.len()).into_par_iter().map(|n| field[(n % lines) * length + n / lines]).collect();
        *field = turned;
    }
}

impl Autocorrelation {
    /// The mean autocorrelation of the tiles at `corners`, each of unit variance, and the largest standard deviation of
    /// a tile over its mean. Each shift is divided by the share of pixels that overlap, so long shifts are noisier but
    /// not lower. None if every tile is flat.
    pub fn of(image: ArrayView2<f32>, corners: &[[usize; 2]], tile: [usize; 2]) -> Option<(Self, f64)> {
        let reach = tile.map(|side| (side as f64 * REACH) as i64);
        let padded = [0, 1].map(|axis| smooth_size(tile[axis] + reach[axis] as usize + 1));
        let mut sum = vec![0.0; padded[0] * padded[1]];
        let (mut tiles, mut deviation) = (0, 0f64);
        for corner in corners {
            let piece = image.slice(s![corner[1]..corner[1] + tile[1], corner[0]..corner[0] + tile[0]]);
            let Some((spectrum, relative)) = power(piece, padded) else { continue };
            sum.iter_mut().zip(&spectrum).for_each(|(sum, power)| *sum += power);
            tiles += 1;
            deviation = deviation.max(relative);
        }
        if tiles == 0 {
            return None;
        }
        let mut field: Vec<Complex<f64>> = sum.iter().map(|&power| Complex::new(power, 0.0)).collect();
        transform(&mut field, padded, FftDirection::Inverse);

        let total = field[0].re;
        let shape = (2 * reach[1] as usize + 1, 2 * reach[0] as usize + 1);
        let value = Array2::from_shape_fn(shape, |(row, column)| {
            let (dx, dy) = (column as i64 - reach[0], row as i64 - reach[1]);
            let wrapped = |shift: i64, axis: usize| shift.rem_euclid(padded[axis] as i64) as usize;
            let common = (1.0 - dx.abs() as f64 / tile[0] as f64) * (1.0 - dy.abs() as f64 / tile[1] as f64);
            field[wrapped(dy, 1) * padded[0] + wrapped(dx, 0)].re / (total * common)
        });
        Some((Self { value, reach, tile: tile.map(|side| side as f64), tiles: tiles as f64 }, deviation))
    }

    /// The coefficient at a shift. None beyond the reach.
    fn at(&self, x: i64, y: i64) -> Option<f64> {
        let (column, row) = (x + self.reach[0], y + self.reach[1]);
        (column >= 0 && row >= 0).then(|| self.value.get((row as usize, column as usize)).copied()).flatten()
    }

    /// Shifts in the lower half plane that are the highest within 0.35 of their length, with their coefficients. The
    /// limit leaves out the flank of the peak at zero shift and noise on a broad peak.
    pub fn peaks(&self) -> Vec<(DVec2, f64)> {
        let [reach_x, reach_y] = self.reach;
        let candidates: Vec<(i64, i64)> = (0..=reach_y)
            .flat_map(|y| (-reach_x..=reach_x).map(move |x| (x, y)))
            .filter(|&(x, y)| (y > 0 || x > 0) && ((x * x + y * y) as f64) >= SHORTEST_PX * SHORTEST_PX)
            .collect();
        candidates
            .into_par_iter()
            .filter_map(|(x, y)| {
                let value = self.at(x, y)?;
                let beaten = |radius: f64| {
                    let reach = radius.ceil() as i64;
                    (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy))).any(|(dx, dy)| {
                        ((dx * dx + dy * dy) as f64) <= radius * radius
                            && self.at(x + dx, y + dy).is_some_and(|other| other > value)
                    })
                };
                let length = ((x * x + y * y) as f64).sqrt();
                let inside = x.abs() < reach_x && y < reach_y;
                if !inside || value < self.noise(x, y) || beaten(1.5) || beaten(0.35 * length) {
                    return None;
                }
                Some(self.summit(x, y))
            })
            .collect()
    }

    /// Level that noise does not reach at a shift: seven standard deviations, for a hundred thousand shifts are tried.
    fn noise(&self, x: i64, y: i64) -> f64 {
        let common = (self.tile[0] - x.abs() as f64) * (self.tile[1] - y.abs() as f64);
        7.0 / (common * self.tiles).sqrt()
    }

    /// Position and height of a peak, from a parabola through it and its neighbours along each axis.
    fn summit(&self, x: i64, y: i64) -> (DVec2, f64) {
        let here = self.at(x, y).unwrap_or(0.0);
        let top = |before: Option<f64>, after: Option<f64>| match (before, after) {
            (Some(before), Some(after)) if 2.0 * here - before - after > 0.0 => {
                let step = (0.5 * (after - before) / (2.0 * here - before - after)).clamp(-0.5, 0.5);
                (step, 0.25 * (after - before) * step)
            }
            _ => (0.0, 0.0),
        };
        let (dx, above_x) = top(self.at(x - 1, y), self.at(x + 1, y));
        let (dy, above_y) = top(self.at(x, y - 1), self.at(x, y + 1));
        (DVec2::new(x as f64 + dx, y as f64 + dy), here + above_x + above_y)
    }

    /// The basis that best fits the peaks at its multiples, taken in over growing distances.
    pub fn refined(&self, mut basis: DMat2, highest: f64) -> DMat2 {
        let farthest = self.reach[0].max(self.reach[1]) as f64 / shortest(basis);
        let mut ring = 2.0;
        while ring <= farthest.max(2.0) {
            let (mut normal, mut right) = (DMat2::ZERO, DMat2::ZERO);
            let steps = ring.ceil() as i64;
            for (m, n) in (-steps..=steps).flat_map(|m| (0..=steps).map(move |n| (m, n))) {
                let index = DVec2::new(m as f64, n as f64);
                if index.length() > ring || (n == 0 && m <= 0) {
                    continue;
                }
                let Some(found) = self.climb(basis * index, 0.25 * shortest(basis)) else { continue };
                if self.at(found.x.round() as i64, found.y.round() as i64) > Some(0.5 * highest) {
                    normal += outer(index, index);
                    right += outer(found, index);
                }
            }
            if normal.determinant() > 0.0 {
                basis = right * normal.inverse();
            }
            ring *= 1.5;
        }
        reduced(basis)
    }

    /// The peak that climbing from a position reaches. None if the climb leaves the reach or ends too far away.
    fn climb(&self, from: DVec2, limit_px: f64) -> Option<DVec2> {
        let (mut x, mut y) = (from.x.round() as i64, from.y.round() as i64);
        let mut height = self.at(x, y)?;
        loop {
            let mut best = (height, x, y);
            for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                let value = self.at(x + dx, y + dy)?;
                if value > best.0 {
                    best = (value, x + dx, y + dy);
                }
            }
            if (best.1, best.2) == (x, y) {
                break;
            }
            (height, x, y) = best;
        }
        let (summit, _) = self.summit(x, y);
        (summit.distance(from) <= limit_px.max(1.5)).then_some(summit)
    }
}
