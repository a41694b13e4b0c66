//! The first guess at the lattice: the two shortest shifts that bring a white image onto itself.
//!
//! Autocorrelation, because a lattice vector is a peak of it whatever the discs look like, where the spectrum of discs
//! that touch in a hexagonal lattice nearly vanishes at its fundamental.

use crate::Refusal;
use glam::{DMat2, DVec2};
use ndarray::{Array2, ArrayView2, s};
use rayon::prelude::*;
use rustfft::{FftDirection, FftPlanner, num_complex::Complex};

/// Longest side of a piece of the image that is correlated, px: holds seven lenslets of 150 px.
const TILE_PX: usize = 1024;
/// Shortest lattice vector that is looked for, px.
const SHORTEST_PX: f64 = 3.0;
/// Longest shift, as a share of the tile's side.
const REACH: f64 = 0.6;
/// Share of the highest peak that a lattice vector reaches. Between touching hexagonal discs the places a third of the
/// way along the long diagonal reach 0.3, and true vectors differ from one another by noise only.
const LATTICE_PEAK: f64 = 0.8;
/// Least contrast of what repeats, root mean square over mean. Discs that touch have 0.33 to 0.53; the dark lines that
/// a matched square aperture leaves between its images, 0.01 px wide at 14 px, have 0.004.
pub(crate) const LEAST_CONTRAST: f64 = 0.02;

const WANTED: &str = "a white image with dark gaps between the discs of the lenslets";

/// Two shifts that bring the image onto itself.
#[derive(Debug, Clone)]
pub(crate) struct Period {
    /// Columns u and v, px, as [`reduced`] gives them.
    pub basis_px: DMat2,
    /// Root mean square of what repeats over the mean count.
    pub contrast: f64,
    /// Corners (column, row) of the pieces that were looked at, and their size.
    pub corners: Vec<[usize; 2]>,
    /// Columns and rows of a piece.
    pub tile: [usize; 2],
}

/// Finds the period of an image of counts. Cost: five pieces at most, whatever the size of the image.
pub(crate) fn find(image: ArrayView2<f32>) -> Result<Period, Refusal> {
    let (height, width) = image.dim();
    let tile = [width.min(TILE_PX), height.min(TILE_PX)];
    let corners = corners([width, height], tile);
    let (correlation, deviation) = autocorrelation(image, &corners, tile)?;
    let none = |contrast: f64| {
        Refusal::new(
            format!("no lattice: the contrast of what repeats is {:.2} %", 100.0 * contrast),
            format!("wanted {WANTED} (at least {} %)", 100.0 * LEAST_CONTRAST),
        )
    };

    let peaks = correlation.peaks();
    let highest = peaks.iter().map(|peak| peak.1).fold(0.0, f64::max);
    let contrast = highest.sqrt() * deviation;
    if contrast < LEAST_CONTRAST {
        return Err(none(contrast));
    }
    let mut high: Vec<DVec2> = peaks.iter().filter(|peak| peak.1 > LATTICE_PEAK * highest).map(|peak| peak.0).collect();
    high.sort_by(|a, b| a.length().total_cmp(&b.length()).then(a.x.total_cmp(&b.x)));
    let first = high[0];
    let second = high.iter().find(|w| (first.perp_dot(**w) / (first.length() * w.length())).abs() > 0.4);
    let Some(&second) = second else {
        return Err(Refusal::new(
            format!("repeats every {:.1} px in one direction only", first.length()),
            format!("wanted {WANTED}"),
        ));
    };
    let basis = reduced(DMat2::from_cols(first, second));
    Ok(Period { basis_px: correlation.refined(basis, highest), contrast, corners, tile })
}

/// The same lattice by its two shortest vectors, 60 to 90 degrees apart, turning from x towards y, the first nearest to x.
pub(crate) fn reduced(basis: DMat2) -> DMat2 {
    let (mut u, mut v) = (basis.x_axis, basis.y_axis);
    loop {
        if v.length_squared() < u.length_squared() {
            (u, v) = (v, u);
        }
        let shorter = v - (u.dot(v) / u.length_squared()).round() * u;
        // Vectors 60 degrees apart are as short as their difference: without a margin they would change for ever.
        if shorter.length() < (1.0 - 1e-9) * v.length() {
            v = shorter;
        } else {
            break;
        }
    }
    if u.dot(v) < 0.0 {
        v = -v;
    }
    if u.perp_dot(v) < 0.0 {
        (u, v) = (v, u);
    }
    // Six vectors of nearly one length where u and v are 60 degrees apart, four where they are 90.
    let hexagonal = u.dot(v) > 0.25 * u.length() * v.length();
    let mut turned = [(u, v); 6];
    for n in 1..6 {
        let (u, v) = turned[n - 1];
        turned[n] = if hexagonal { (v, v - u) } else { (v, -u) };
    }
    let along = |pair: &(DVec2, DVec2)| pair.0.x / pair.0.length();
    let (u, v) = turned.into_iter().max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or((u, v));
    DMat2::from_cols(u, v)
}

/// Length of the shorter vector.
pub(crate) fn shortest(basis: DMat2) -> f64 {
    basis.x_axis.length().min(basis.y_axis.length())
}

/// The middle and the four quarters of the image, once each.
fn corners(size: [usize; 2], tile: [usize; 2]) -> Vec<[usize; 2]> {
    let spare = [size[0] - tile[0], size[1] - tile[1]];
    let mut corners = vec![[spare[0] / 2, spare[1] / 2]];
    for (x, y) in [(1, 1), (3, 1), (1, 3), (3, 3)] {
        let corner = [spare[0] * x / 4, spare[1] * y / 4];
        if !corners.contains(&corner) {
            corners.push(corner);
        }
    }
    corners
}

/// Correlation coefficient at every shift up to `reach`, rows and columns counted from `-reach`.
struct Correlation {
    value: Array2<f64>,
    reach: [i64; 2],
    tile: [f64; 2],
    pieces: f64,
}

/// The mean over the pieces of the autocorrelation, each piece scaled to unit variance, and the largest deviation of a
/// piece over its mean. A shift is weighed by the pixels it leaves in common, so far shifts are noisier, not lower.
fn autocorrelation(
    image: ArrayView2<f32>,
    corners: &[[usize; 2]],
    tile: [usize; 2],
) -> Result<(Correlation, f64), Refusal> {
    let reach = tile.map(|side| (side as f64 * REACH) as i64);
    let padded = [0, 1].map(|axis| smooth_size(tile[axis] + reach[axis] as usize + 1));
    let mut sum = vec![0.0; padded[0] * padded[1]];
    let (mut pieces, mut deviation) = (0, 0f64);
    for corner in corners {
        let piece = image.slice(s![corner[1]..corner[1] + tile[1], corner[0]..corner[0] + tile[0]]);
        let Some((spectrum, relative)) = power(piece, padded) else { continue };
        sum.iter_mut().zip(&spectrum).for_each(|(sum, power)| *sum += power);
        pieces += 1;
        deviation = deviation.max(relative);
    }
    if pieces == 0 {
        let value = image.iter().next().copied().unwrap_or(0.0);
        return Err(Refusal::new(format!("flat, {value} everywhere"), format!("wanted {WANTED}")));
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
    Ok((Correlation { value, reach, tile: tile.map(|side| side as f64), pieces: pieces as f64 }, deviation))
}

/// Power spectrum of a piece less its best plane, at unit variance, and its deviation over its mean; none if it is flat.
fn power(piece: ArrayView2<f32>, padded: [usize; 2]) -> Option<(Vec<f64>, f64)> {
    let (rows, columns) = piece.dim();
    let count = (rows * columns) as f64;
    let (centre_x, centre_y) = (0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0));
    let (mut sum, mut along, mut down) = (0.0, 0.0, 0.0);
    for ((row, column), &value) in piece.indexed_iter() {
        sum += value as f64;
        along += value as f64 * (column as f64 - centre_x);
        down += value as f64 * (row as f64 - centre_y);
    }
    let mean = sum / count;
    let spread = |side: usize| count * ((side * side) as f64 - 1.0).max(1.0) / 12.0;
    let (slope_x, slope_y) = (along / spread(columns), down / spread(rows));
    let mut field = vec![Complex::new(0.0, 0.0); padded[0] * padded[1]];
    let mut squares = 0.0;
    for ((row, column), &value) in piece.indexed_iter() {
        let plane = mean + slope_x * (column as f64 - centre_x) + slope_y * (row as f64 - centre_y);
        let rest = value as f64 - plane;
        squares += rest * rest;
        field[row * padded[0] + column].re = rest;
    }
    let variance = squares / count;
    if mean <= 0.0 || variance.sqrt() < 1e-9 * mean {
        return None;
    }
    transform(&mut field, padded, FftDirection::Forward);
    Some((field.iter().map(|value| value.norm_sqr() / variance).collect(), variance.sqrt() / mean))
}

/// A two-dimensional transform in place, unscaled: rows, then columns.
fn transform(field: &mut Vec<Complex<f64>>, [columns, rows]: [usize; 2], direction: FftDirection) {
    let mut planner = FftPlanner::new();
    for length in [columns, rows] {
        let fft = planner.plan_fft(length, direction);
        field.par_chunks_mut(length).for_each(|line| fft.process(line));
        // Both passes end with a transposition: the second one restores the order.
        let lines = field.len() / length;
        let turned: Vec<Complex<f64>> =
            (0..field.len()).into_par_iter().map(|n| field[(n % lines) * length + n / lines]).collect();
        *field = turned;
    }
}

/// The next size that has no prime factor above 5.
fn smooth_size(least: usize) -> usize {
    (least..)
        .find(|&size| {
            let mut rest = size;
            for factor in [2, 3, 5] {
                while rest % factor == 0 {
                    rest /= factor;
                }
            }
            rest == 1
        })
        .expect("powers of two have no end")
}

impl Correlation {
    fn at(&self, x: i64, y: i64) -> Option<f64> {
        let (column, row) = (x + self.reach[0], y + self.reach[1]);
        (column >= 0 && row >= 0).then(|| self.value.get((row as usize, column as usize)).copied()).flatten()
    }

    /// Shifts in the lower half plane, and their values, that are the highest within a third of their own length:
    /// neither the flank of the peak at no shift nor noise on a broad peak passes.
    fn peaks(&self) -> Vec<(DVec2, f64)> {
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

    /// What pure noise does not reach at a shift: seven standard deviations, for a hundred thousand shifts are tried.
    fn noise(&self, x: i64, y: i64) -> f64 {
        let common = (self.tile[0] - x.abs() as f64) * (self.tile[1] - y.abs() as f64);
        7.0 / (common * self.pieces).sqrt()
    }

    /// Place and height of the parabola's top through a peak and its neighbours.
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

    /// The basis that best fits the peaks at ever farther multiples of it.
    fn refined(&self, mut basis: DMat2, highest: f64) -> DMat2 {
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

    /// The summit reached from a place by climbing; none if it leads out or too far.
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

/// a b'.
fn outer(a: DVec2, b: DVec2) -> DMat2 {
    DMat2::from_cols(a * b.x, a * b.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    // Two vectors exactly 60 degrees apart once changed places without end.
    #[test]
    fn a_basis_is_reduced_to_the_one_along_the_rows() {
        for angle in [60.0f64, 90.0] {
            let wanted = DMat2::from_cols(DVec2::X, DVec2::from_angle(angle.to_radians()));
            for turn in [-0.4, -0.1, 0.0, 0.2, 0.5] {
                let wanted = 14.0 * DMat2::from_angle(turn) * wanted;
                for (a, b, c, d) in [(1, 0, 0, 1), (0, 1, 1, 0), (3, 2, 1, 1), (-1, 4, 0, -1), (2, -5, 1, -2)] {
                    let mixed = DMat2::from_cols(
                        wanted * DVec2::new(a as f64, b as f64),
                        wanted * DVec2::new(c as f64, d as f64),
                    );
                    let found = reduced(mixed);
                    assert!((found - wanted).abs_diff_eq(DMat2::ZERO, 1e-9), "{angle} {turn} {mixed}: {found}");
                }
            }
        }
    }
}
