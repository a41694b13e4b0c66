//! The noise of an image, measured where it is darkest.

use crate::statistics::upper_median;
use ndarray::{ArrayView2, s};
use rayon::prelude::*;

/// Side of a tile, px. The noise of an image smaller than a tile is 0.
const TILE: usize = 4;

/// Fraction of the tiles, from the darkest, that count as places without light.
const DARKEST: f64 = 0.05;

/// Standard deviation of the pixels where the image is darkest, counts: the median over the darkest twentieth of its
/// tiles of 4 x 4 px. Light in those tiles counts as noise. An image clipped at 0 shows about 0.6 of its noise.
pub fn noise(image: ArrayView2<f32>) -> f64 {
    let (height, width) = image.dim();
    let mean_and_variance = |row: usize, column: usize| {
        let (mut sum, mut squares) = (0.0, 0.0);
        for value in image.slice(s![row * TILE..(row + 1) * TILE, column * TILE..(column + 1) * TILE]) {
            let value = f64::from(*value);
            sum += value;
            squares += value * value;
        }
        let count = (TILE * TILE) as f64;
        let mean = sum / count;
        (mean, (squares / count - mean * mean).max(0.0) * count / (count - 1.0))
    };
    let rows = (0..height / TILE).into_par_iter();
    let tiles = rows.flat_map_iter(|row| (0..width / TILE).map(move |column| mean_and_variance(row, column)));
    let mut tiles: Vec<(f64, f64)> = tiles.collect();
    if tiles.is_empty() {
        return 0.0;
    }
    let darkest = (tiles.len() as f64 * DARKEST).ceil() as usize;
    tiles.select_nth_unstable_by(darkest - 1, |a, b| a.0.total_cmp(&b.0));
    let mut variances: Vec<f64> = tiles[..darkest].iter().map(|(_, variance)| *variance).collect();
    upper_median(&mut variances).map_or(0.0, f64::sqrt)
}
