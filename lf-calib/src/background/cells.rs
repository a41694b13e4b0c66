//! Square cells over an image, about a lenslet each: sums over their pixels, smooth from cell to cell.

use ndarray::Array2;
use rayon::prelude::*;

/// A Gaussian ends after this many standard deviations.
const ENDS: f64 = 3.0;

/// Cells over an image.
#[derive(Debug, Clone)]
pub struct Cells {
    /// Rows and columns of pixels, and of cells.
    pixels: (usize, usize),
    cells: (usize, usize),
    /// Pixels of a cell along an axis.
    side_px: f64,
}

impl Cells {
    /// Cells of about `cell_px` over an image of this many rows and columns.
    pub fn new(pixels: (usize, usize), cell_px: f64) -> Self {
        let count = |pixels: usize| ((pixels as f64 / cell_px).ceil() as usize).max(1);
        Self { pixels, cells: (count(pixels.0), count(pixels.1)), side_px: cell_px.max(1.0) }
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.cells.0 * self.cells.1
    }

    /// The cell of a pixel.
    pub fn of(&self, (row, column): (usize, usize)) -> usize {
        let along = |n: usize, count: usize| ((n as f64 / self.side_px) as usize).min(count - 1);
        along(row, self.cells.0) * self.cells.1 + along(column, self.cells.1)
    }

    /// Sums of `value` over the pixels of each cell.
    pub fn sums<const N: usize>(&self, value: impl Fn((usize, usize)) -> Option<[f64; N]> + Sync) -> Vec<[f64; N]> {
        let of_row = |cell_row: usize| {
            let edge = |n: usize| ((n as f64 * self.side_px).ceil() as usize).min(self.pixels.0);
            let end = if cell_row + 1 == self.cells.0 { self.pixels.0 } else { edge(cell_row + 1) };
            let mut sums = vec![[0.0; N]; self.cells.1];
            for row in edge(cell_row)..end {
                for column in 0..self.pixels.1 {
                    let Some(more) = value((row, column)) else { continue };
                    let sum = &mut sums[self.of((row, column)) % self.cells.1];
                    sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
                }
            }
            sums
        };
        (0..self.cells.0).into_par_iter().flat_map_iter(of_row).collect()
    }

    /// Sums over a Gaussian of `sigma` cells around each cell.
    pub fn smooth<const N: usize>(&self, sums: Vec<[f64; N]>, sigma: f64) -> Vec<[f64; N]> {
        let reach = (ENDS * sigma).ceil() as usize;
        let weight: Vec<f64> = (0..=reach).map(|n| (-0.5 * (n as f64 / sigma.max(1e-9)).powi(2)).exp()).collect();
        let pass = |sums: &[[f64; N]], count: usize, step: usize| -> Vec<[f64; N]> {
            let of_cell = |cell: usize| {
                let along = cell / step % count;
                let mut sum = [0.0; N];
                for other in along.saturating_sub(reach)..(along + reach + 1).min(count) {
                    let there = sums[cell + other * step - along * step];
                    let weight = weight[other.abs_diff(along)];
                    sum.iter_mut().zip(there).for_each(|(sum, there)| *sum += weight * there);
                }
                sum
            };
            (0..sums.len()).into_par_iter().map(of_cell).collect()
        };
        pass(&pass(&sums, self.cells.1, 1), self.cells.0, self.cells.1)
    }

    /// An image of `value` of each pixel and what holds there, linear between the middles of the cells.
    pub fn map<const N: usize>(
        &self,
        cells: &[[f64; N]],
        value: impl Fn((usize, usize), [f64; N]) -> f32 + Sync,
    ) -> Array2<f32> {
        let between = |n: usize, count: usize| {
            let at = ((n as f64 + 0.5) / self.side_px - 0.5).clamp(0.0, (count - 1) as f64);
            let low = (at as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), at - low as f64)
        };
        let of_row = |row: usize| {
            let (top, bottom, down) = between(row, self.cells.0);
            (0..self.pixels.1).map(move |column| {
                let (left, right, aside) = between(column, self.cells.1);
                let here = std::array::from_fn(|k| {
                    let at = |row: usize, column: usize| cells[row * self.cells.1 + column][k];
                    let along = |row: usize| at(row, left) + aside * (at(row, right) - at(row, left));
                    along(top) + down * (along(bottom) - along(top))
                });
                ((row, column), here)
            })
        };
        let pixels = (0..self.pixels.0).into_par_iter().flat_map_iter(of_row);
        let pixels = pixels.map(|(place, here)| value(place, here)).collect();
        Array2::from_shape_vec(self.pixels, pixels).expect("a value for each pixel")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_hold_every_pixel_and_smoothing_keeps_an_even_mean() {
        for (pixels, cell_px) in [((31, 47), 7.3), ((5, 90), 14.0), ((3, 3), 20.0)] {
            let cells = Cells::new(pixels, cell_px);
            let sums = cells.sums(|place| (place != (1, 1)).then_some([1.0, place.1 as f64]));
            let all: f64 = sums.iter().map(|sum| sum[0]).sum();
            assert_eq!(all, (pixels.0 * pixels.1 - 1) as f64);
            for sum in cells.smooth(cells.sums(|_| Some([1.0, 5.0])), 2.0) {
                assert!((sum[1] / sum[0] - 5.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_map_is_linear_between_the_cells() {
        let cells = Cells::new((20, 40), 10.0);
        let values: Vec<[f64; 1]> = (0..8).map(|n| [f64::from(n % 4) + 10.0 * f64::from(n / 4)]).collect();
        let image = cells.map(&values, |_, [value]| value as f32);
        assert!((image[[10, 20]] - 7.05).abs() < 1e-5 && image[[0, 0]] == 0.0 && image[[19, 39]] == 13.0, "{image}");
    }
}
