//! Haze: light that follows the lenslet images, as that of a white image does, and is smooth from lenslet to lenslet.
//! Fluorescence of a whole volume and scattered light make it.

use super::cells::Cells;
use crate::mean::other_size;
use lf_core::Refusal;
use lf_core::statistics::median;
use ndarray::Array2;
use rayon::prelude::*;

/// The haze of a frame.
#[derive(Debug, Clone)]
pub struct Haze {
    /// Counts of each pixel without particles: `offset + share * white`, both smooth over the frame.
    pub pixels: Array2<f32>,
    /// Median of the offset, counts.
    pub offset: f64,
    /// Median of the share of the white image.
    pub share: f64,
    /// Rounds until the weights were settled.
    pub rounds: usize,
}

/// Rounds end when the weights change by less than this share, or at the second number.
const SETTLED: f64 = 1e-3;
const MOST_ROUNDS: usize = 60;
/// A white image that varies by less than this share of its mean shows no offset.
const LEAST_CONTRAST: f64 = 0.05;
/// The noise of a pixel grows as the root of its light; the darkest have that of this share of the mean light.
const DARKEST: f64 = 0.05;

/// The haze of `frame`, which follows `white`. Offset and share are means over a Gaussian whose standard deviation is
/// `reach` cells; a cell is `cell_px` wide, about a lenslet. Pixels without a number do not count.
///
/// Method: asymmetrically reweighted least squares (Baek et al. 2015, Analyst 140, 250). Pixels lose their weight where
/// they stand above the noise of those below the haze.
pub fn haze(frame: &Array2<f32>, white: &Array2<f32>, cell_px: f64, reach: f64) -> Result<Haze, Refusal> {
    if white.dim() != frame.dim() {
        return Err(other_size(white, frame.dim()));
    }
    let lit: Vec<f64> = frame.iter().filter(|count| count.is_finite()).map(|count| f64::from(*count)).collect();
    let darkest = DARKEST * lit.iter().sum::<f64>() / lit.len().max(1) as f64;
    Refusal::unless(darkest > 0.0, || "no light", "wanted a frame and its white image")?;
    let fit = Fit { frame, white, cells: Cells::new(frame.dim(), cell_px), reach, darkest };

    // Fit, weigh, and fit again.
    let mut weights = Array2::from_elem(frame.dim(), 1f32);
    let mut lines = fit.lines(&weights);
    let mut rounds = 0;
    let mut change = f64::INFINITY;
    while rounds < MOST_ROUNDS && change > SETTLED {
        change = fit.reweigh(&lines, &mut weights);
        lines = fit.lines(&weights);
        rounds += 1;
    }
    let pixels = fit.cells.map(&lines, |place, [offset, share]| (offset + share * f64::from(white[place])) as f32);
    let [offset, share] = [0, 1].map(|k| median(&mut lines.iter().map(|line| line[k]).collect::<Vec<_>>()));
    Ok(Haze { pixels, offset, share, rounds })
}

/// The images, and how they are fitted.
struct Fit<'a> {
    frame: &'a Array2<f32>,
    white: &'a Array2<f32>,
    cells: Cells,
    reach: f64,
    darkest: f64,
}

impl Fit<'_> {
    /// Counts of the frame and of the white image; None without a number.
    fn counts(&self, place: (usize, usize)) -> Option<[f64; 2]> {
        let counts = [self.frame[place], self.white[place]].map(f64::from);
        counts.iter().all(|count| count.is_finite()).then_some(counts)
    }

    /// Offset and share of each cell by weighted least squares. Near the frame's edge a mean over a slope is off: what
    /// the first lines leave is fitted again.
    fn lines(&self, weights: &Array2<f32>) -> Vec<[f64; 2]> {
        let first = self.lines_of_rest(weights, &vec![[0.0; 2]; self.cells.count()]);
        let second = self.lines_of_rest(weights, &first);
        // A share below zero would be light taken away from the dark.
        let within = |([a, b], [c, d]): (&[f64; 2], [f64; 2])| [a + c, (b + d).max(0.0)];
        first.iter().zip(second).map(within).collect()
    }

    /// Offset and share of what `lines` leave.
    fn lines_of_rest(&self, weights: &Array2<f32>, lines: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let sums = self.cells.sums(|place| {
            let ([seen, white], [offset, share]) = (self.counts(place)?, lines[self.cells.of(place)]);
            let (rest, weight) = (seen - offset - share * white, f64::from(weights[place]));
            Some([1.0, white, white * white, rest, white * rest].map(|term| weight * term))
        });
        let line = |[w, x, xx, y, xy]: [f64; 5]| {
            let spread = w * xx - x * x;
            match spread > LEAST_CONTRAST * LEAST_CONTRAST * x * x {
                true => [(y * xx - x * xy) / spread, (w * xy - x * y) / spread],
                false => [0.0, xy / xx.max(f64::MIN_POSITIVE)],
            }
        };
        self.cells.smooth(sums, self.reach).into_iter().map(line).collect()
    }

    /// The difference of a pixel from the haze, over the root of the haze, and the haze.
    fn difference(&self, place: (usize, usize), [offset, share]: [f64; 2]) -> Option<[f64; 2]> {
        let [seen, white] = self.counts(place)?;
        let haze = offset + share * white;
        let variance = haze.max(self.darkest);
        Some([(seen - haze) / variance.sqrt(), variance])
    }

    /// Weighs the pixels by the lines. Returns the change of the weights.
    fn reweigh(&self, lines: &[[f64; 2]], weights: &mut Array2<f32>) -> f64 {
        // Mean and deviation of the pixels below the haze.
        let below = self.cells.sums(|place| {
            let [difference, _] = self.difference(place, lines[self.cells.of(place)])?;
            (difference < 0.0).then_some([1.0, difference, difference * difference])
        });
        let noise = |[count, sum, squares]: [f64; 3]| {
            let count = count.max(f64::MIN_POSITIVE);
            [sum / count, (squares / count - (sum / count).powi(2)).max(f64::MIN_POSITIVE).sqrt()]
        };
        let below: Vec<[f64; 2]> = self.cells.smooth(below, self.reach).into_iter().map(noise).collect();

        // The logistic weight of the method, over the variance.
        let of_row = |(row, line): (usize, &mut [f32])| {
            let (mut change, mut sum) = (0.0, 0.0);
            for (column, weight) in line.iter_mut().enumerate() {
                let (place, cell) = ((row, column), self.cells.of((row, column)));
                let Some([difference, variance]) = self.difference(place, lines[cell]) else { continue };
                let [mean, deviation] = below[cell];
                let above = 2.0 * (difference - (2.0 * deviation - mean)) / deviation;
                let now = 1.0 / (1.0 + above.exp()) / variance;
                change += (now - f64::from(*weight)).abs();
                sum += now;
                *weight = now as f32;
            }
            [change, sum]
        };
        let width = weights.ncols();
        let rows = weights.as_slice_mut().expect("made in this layout").par_chunks_mut(width).enumerate();
        let sums: Vec<[f64; 2]> = rows.map(of_row).collect();
        let [change, sum] = sums.iter().fold([0.0; 2], |[a, b], [change, sum]| [a + change, b + sum]);
        change / sum.max(f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand_pcg::Pcg64Mcg;

    const SIDE: usize = 210;

    /// Lenslet images of 14 px: 20 counts between them and 400 within.
    fn white() -> Array2<f32> {
        let aside = |n: usize| (n % 14) as f32 - 6.5;
        Array2::from_shape_fn((SIDE, SIDE), |(y, x)| if aside(x).hypot(aside(y)) < 6.0 { 400.0 } else { 20.0 })
    }

    /// The share of the white image in the haze, which rises along x.
    fn share(x: usize) -> f32 {
        0.5 + x as f32 / SIDE as f32
    }

    /// A frame of haze on 100 counts, noise of one count an electron, and particles on a part of the lenslets.
    fn frame(white: &Array2<f32>, lenslets: f32) -> Array2<f32> {
        let mut random = Pcg64Mcg::new(9);
        let bright = Array2::from_shape_simple_fn((SIDE / 14, SIDE / 14), || random.random::<f32>() < lenslets);
        let mut normal = || (0..12).map(|_| random.random::<f32>()).sum::<f32>() - 6.0;
        Array2::from_shape_fn((SIDE, SIDE), |(y, x)| {
            let light = if bright[[y / 14, x / 14]] && x % 3 == 0 { 900.0 } else { 0.0 };
            let mean = 100.0 + share(x) * white[[y, x]] + light;
            mean + mean.sqrt() * normal()
        })
    }

    #[test]
    fn haze_comes_back_beside_particles() {
        let white = white();
        for lenslets in [0.0, 0.3, 0.9] {
            let found = haze(&frame(&white, lenslets), &white, 14.0, 2.0).unwrap();
            assert!((found.offset - 100.0).abs() < 4.0 && (found.share - 1.0).abs() < 0.05, "{found:?}");
            let off = found.pixels.indexed_iter().map(|((y, x), haze)| haze - 100.0 - share(x) * white[[y, x]]);
            let rms = (off.map(|off| f64::from(off).powi(2)).sum::<f64>() / (SIDE * SIDE) as f64).sqrt();
            assert!(rms < 10.0, "{lenslets}: {rms}");
        }
    }

    #[test]
    fn blind_pixels_and_white_without_contrast_are_no_trouble() {
        let white = white();
        let mut blind = frame(&white, 0.3);
        blind.slice_mut(ndarray::s![.., 20..30]).fill(f32::NAN);
        assert!((haze(&blind, &white, 14.0, 2.0).unwrap().share - 1.0).abs() < 0.05);
        let even = Array2::from_elem((SIDE, SIDE), 50.0);
        let found = haze(&even, &even, 14.0, 2.0).unwrap();
        assert!(found.pixels.iter().all(|haze| (haze - 50.0).abs() < 1e-3));
        assert!(haze(&even, &Array2::zeros((5, 5)), 14.0, 2.0).is_err());
        assert!(haze(&Array2::zeros((40, 40)), &Array2::zeros((40, 40)), 14.0, 2.0).is_err());
    }
}
