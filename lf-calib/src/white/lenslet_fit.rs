//! One lenslet image, read against the mean cell: its centre, its brightness and the quality of the fit.

use super::{basis::shortest, cats_eye::Untouched, mean_cell::MeanCell};
use crate::fit::placement::{PlaceFit, PlaceSums, StepLimits, fit_place};
use glam::{DMat2, DVec2};
use ndarray::ArrayView2;

/// Radius of the window of pixels, in shortest lattice vectors. The rims of discs that touch are well inside.
const WINDOW: f64 = 0.62;
/// Smallest share of the window inside the image. Half a disc at the edge of the frame can still be read.
const LEAST_INSIDE: f64 = 0.7;
/// Largest distance of a centre from its prediction, in shortest lattice vectors.
const FARTHEST: f64 = 0.35;
/// Smallest share of the window's pixels that a second stop leaves untouched. A third of a rim still gives a centre.
const LEAST_UNTOUCHED: f64 = 0.4;

#[derive(Clone, Copy)]
pub(crate) struct LensletFit {
    pub centre_px: DVec2,
    /// Counts where the cell is 0.
    pub floor: f64,
    /// Counts per unit of the cell.
    pub gain: f64,
    /// Relative change of the gain across the lenslet per px, as it was given.
    pub shade_per_px: DVec2,
    /// Standard deviation of a coordinate of the centre, px, for noise of one count in each pixel.
    pub spread_px: f64,
    pub explained: f64,
}

/// The (row, column) of the pixels around a position, and their offset from it, px. None if too many are outside.
pub(crate) fn window(
    centre_px: DVec2,
    shortest_px: f64,
    (height, width): (usize, usize),
) -> Option<impl Iterator<Item = ((usize, usize), DVec2)>> {
    let radius = WINDOW * shortest_px;
    let whole = std::f64::consts::PI * radius * radius;
    let rows = inside(centre_px.y, radius, height);
    let columns = move |row: usize| {
        let dy = row as f64 + 0.5 - centre_px.y;
        inside(centre_px.x, (radius * radius - dy * dy).max(0.0).sqrt(), width)
    };
    let count: usize = rows.clone().map(|row| columns(row).len()).sum();
    let offset = move |row: usize, column: usize| DVec2::new(column as f64 + 0.5, row as f64 + 0.5) - centre_px;
    (count as f64 >= LEAST_INSIDE * whole)
        .then(|| rows.flat_map(move |row| columns(row).map(move |column| ((row, column), offset(row, column)))))
}

/// Pixels of a row or column whose centres lie within `reach` of `centre`.
fn inside(centre: f64, reach: f64, size: usize) -> std::ops::Range<usize> {
    let first = (centre - reach - 0.5).ceil().max(0.0) as usize;
    let end = ((centre + reach - 0.5).floor() + 1.0).clamp(0.0, size as f64) as usize;
    first..end.max(first)
}

impl LensletFit {
    /// A count at an offset from the centre, in units of the cell.
    pub fn level(&self, count: f64, offset_px: DVec2) -> f64 {
        (count - self.floor) / (self.gain * (1.0 + self.shade_per_px.dot(offset_px)))
    }
}

/// Fits floor + gain (1 + shade . x) T(x - centre) to the pixels around `from_px`, with x from `from_px`, by
/// Gauss-Newton. The shade is given: within one lenslet it cannot be separated from a shift. None if the window leaves
/// the image, if the centre moves too far, or if there is no light.
pub(crate) fn fit_lenslet(
    image: ArrayView2<f32>,
    cell: &MeanCell,
    basis_px: DMat2,
    from_px: DVec2,
    shade_per_px: DVec2,
    untouched: Option<&Untouched>,
) -> Option<LensletFit> {
    let shortest = shortest(basis_px);
    let to_cell = basis_px.inverse();
    let slope_to_px = to_cell.transpose();
    // Offset from `from_px`, px, count and relative gain of the pixels that a second stop leaves.
    let (mut seen, mut pixels) = (0, Vec::with_capacity(256));
    for (pixel, offset) in window(from_px, shortest, image.dim())? {
        seen += 1;
        if untouched.is_none_or(|untouched| untouched.holds(offset)) {
            pixels.push((offset, image[pixel] as f64, 1.0 + shade_per_px.dot(offset)));
        }
    }
    if (pixels.len() as f64) < LEAST_UNTOUCHED * seen as f64 {
        return None;
    }
    // Gauss-Newton squares the error: after a step of 0.03 px it is far below the noise.
    let limits = StepLimits { steps: 8, longest_px: 0.12 * shortest, small_px: 0.03, farthest_px: FARTHEST * shortest };
    let fit = fit_place(from_px, &limits, |centre| {
        let mut sums = PlaceSums::default();
        for (offset, count, shade) in &pixels {
            let (value, slope) = cell.at(to_cell * (*offset + from_px - centre));
            sums.add(shade * value, *shade * (slope_to_px * slope), *count);
        }
        sums
    })?;
    let PlaceFit { place_px, floor, gain, spread_px, explained, .. } = fit;
    Some(LensletFit { centre_px: place_px, floor, gain, shade_per_px, spread_px, explained })
}
