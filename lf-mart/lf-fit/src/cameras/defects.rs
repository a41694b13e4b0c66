//! Pixels, columns and rows of a sensor that are hot or dead.
//!
//! A particle sends light through several lenslets, or fills a good part of one. A pixel is a defect if it differs from
//! its expected counts and hardly another one around it does.

use super::noise::Noise;
use lf_core::statistics::upper_median;
use ndarray::ArcArray2;
use rayon::prelude::*;

/// Defects that were found. Their pixels are blind.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Defects {
    /// Number of single pixels.
    pub pixels: usize,
    /// Whole columns.
    pub columns: Vec<usize>,
    /// Whole rows.
    pub rows: Vec<usize>,
}

/// A defect differs by this number of standard deviations at least.
const LEAST_SIGMAS: f32 = 10.0;
/// Another pixel is alike from this share of its difference on. Within the third number of pitches of a defect, at most
/// the second number of pixels are.
const ALIKE: f32 = 0.3;
const MOST_ALIKE: usize = 2;
const AROUND: f64 = 1.5;
/// A line is a defect if the median of its pixels differs from those of both lines beside it by this much, and by this
/// number of usual differences in the image: in standard deviations of all pixels, for a bright line, or in shares of
/// the light of lit ones, for a dead one. Lit pixels expect this number of standard deviations. A dead line has this
/// many of them.
const APART_SIGMAS: f32 = 2.0;
const APART_SHARE: f32 = 0.6;
const USUAL: f32 = 20.0;
const LIT_SIGMAS: f32 = 6.0;
const LEAST_LIT: usize = 10;

/// Lines whose value differs by `least` and more from those of both lines beside them, and unusually. NaN is no value.
fn apart(values: &[f32], least: f32) -> Vec<usize> {
    let beside = |three: &[f32]| {
        let [one, other] = [three[1] - three[0], three[1] - three[2]];
        if one * other > 0.0 { one.abs().min(other.abs()) } else { 0.0 }
    };
    let off: Vec<f32> = values.windows(3).map(beside).collect();
    let mut peaks: Vec<f32> = off.iter().copied().filter(|off| *off > 0.0).collect();
    let least = upper_median(&mut peaks).map_or(least, |usual| least.max(USUAL * usual));
    (1..=off.len()).filter(|n| off[n - 1] > least).collect()
}

impl Defects {
    /// Finds defects of a sensor by the counts and the noise that a fit expects, and makes them blind: NaN. Lenslets
    /// are `pitch_px` pixels apart. Returns whether there are new ones.
    pub(crate) fn blind(&mut self, image: &mut ArcArray2<f32>, expected: &[f32], noise: Noise, pitch_px: f64) -> bool {
        let [rows, columns] = [0, 1].map(|axis| Differences { image, expected, noise }.defect_lines(axis));
        rows.iter().for_each(|row| image.row_mut(*row).fill(f32::NAN));
        columns.iter().for_each(|column| image.column_mut(*column).fill(f32::NAN));
        let mut is_new = !(rows.is_empty() && columns.is_empty());
        self.rows.extend(rows);
        self.columns.extend(columns);
        let around = (AROUND * pitch_px).ceil() as usize;
        // Bright defects hide faint ones around them.
        loop {
            let found = Differences { image, expected, noise }.defect_pixels(around);
            found.iter().for_each(|[column, row]| image[(*row, *column)] = f32::NAN);
            if found.is_empty() {
                return is_new;
            }
            is_new = true;
            self.pixels += found.len();
        }
    }
}

/// An image, and what is expected of it.
struct Differences<'a> {
    image: &'a ArcArray2<f32>,
    expected: &'a [f32],
    noise: Noise,
}

impl Differences<'_> {
    /// Counts of a pixel minus those expected, which are NaN if it is blind; the expected ones; and their standard
    /// deviation.
    fn off(&self, row: usize, column: usize) -> [f32; 3] {
        let light = self.expected[row * self.image.ncols() + column];
        [self.image[(row, column)] - light, light, self.noise.variance(light).sqrt()]
    }

    /// Single pixels, column and row, that are alone in a square of `around` pixels to each side. Leaves out the
    /// image's edges, where lenslets beyond it are missing around a pixel.
    fn defect_pixels(&self, around: usize) -> Vec<[usize; 2]> {
        let (height, width) = self.image.dim();
        let of_row = |row: usize| {
            (around..width.saturating_sub(around)).filter_map(move |column| {
                let [off, _, std] = self.off(row, column);
                let is_defect = off.abs() > LEAST_SIGMAS * std && !self.has_others([column, row], off, around);
                is_defect.then_some([column, row])
            })
        };
        (around..height.saturating_sub(around)).into_par_iter().flat_map_iter(of_row).collect()
    }

    /// Whether pixels around a pixel differ about as much from what is expected.
    fn has_others(&self, [column, row]: [usize; 2], off: f32, around: usize) -> bool {
        let mut alike = 0;
        for y in row - around..=row + around {
            for x in column - around..=column + around {
                // The pixel itself is one.
                alike += usize::from(self.off(y, x)[0].abs() > ALIKE * off.abs());
                if alike > MOST_ALIKE + 1 {
                    return true;
                }
            }
        }
        false
    }

    /// Rows, or columns for axis 1.
    fn defect_lines(&self, axis: usize) -> Vec<usize> {
        let [count, length] = [self.image.shape()[axis], self.image.shape()[1 - axis]];
        let line = |n: usize| {
            let (mut sigmas, mut shares) = (Vec::with_capacity(length), Vec::new());
            for k in 0..length {
                let (row, column) = if axis == 0 { (n, k) } else { (k, n) };
                let [off, light, std] = self.off(row, column);
                if !off.is_nan() {
                    sigmas.push(off / std);
                    shares.extend((light > LIT_SIGMAS * std).then_some(off / light));
                }
            }
            let share = upper_median(&mut shares).filter(|_| shares.len() >= LEAST_LIT);
            [upper_median(&mut sigmas), share].map(|median| median.unwrap_or(f32::NAN))
        };
        let medians: Vec<[f32; 2]> = (0..count).into_par_iter().map(line).collect();
        let of = |kind: usize| medians.iter().map(|medians| medians[kind]).collect::<Vec<_>>();
        let mut dead = apart(&of(1), APART_SHARE);
        dead.retain(|n| medians[*n][1] < -APART_SHARE);
        let mut lines = [apart(&of(0), APART_SIGMAS), dead].concat();
        lines.sort_unstable();
        lines.dedup();
        lines
    }
}
