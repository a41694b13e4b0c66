use super::tones::Tones;
use crate::statistics::upper_median;
use ndarray::{ArrayView2, s};
use rayon::prelude::*;

/// Light weaker than this share of the mean brightness, or than this many standard deviations of the noise, is
/// not examined.
const LEAST_SHARE: f64 = 0.01;
const LEAST_NOISE: f64 = 5.0;

/// A mean brightness up to this many times the usual one comes of overlap and of the places of particles.
const COMMON: f64 = 2.0;

/// Brightness of the usual light, counts: [`Tones::light`], unless few particles are much brighter than the others.
/// Then it is the median over tiles of a lenslet's size, each with its own mean brightness. `noise` is the standard
/// deviation of dark pixels.
pub fn usual_light(image: ArrayView2<f32>, lenslet_px: f64, tones: &Tones, noise: f64) -> f64 {
    let side = (lenslet_px.round() as usize).max(1);
    let least = (LEAST_SHARE * tones.light).max(LEAST_NOISE * noise);
    let brightness = |row: usize, column: usize| {
        let tile = image.slice(s![row * side..(row + 1) * side, column * side..(column + 1) * side]);
        let lit = tile.iter().map(|value| f64::from(*value)).filter(|value| *value >= least && *value > 0.0);
        let [light, squares] = lit.fold([0.0; 2], |[sum, squares], value| [sum + value, squares + value * value]);
        (light > 0.0).then(|| squares / light)
    };
    let (rows, columns) = (image.nrows() / side, image.ncols() / side);
    let tiles = (0..rows).into_par_iter();
    let mut lit: Vec<f64> =
        tiles.flat_map_iter(|row| (0..columns).filter_map(move |column| brightness(row, column))).collect();
    match upper_median(&mut lit) {
        Some(usual) if tones.light > COMMON * usual => usual,
        _ => tones.light,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// By hand: nine lit tiles of 10 counts, one of 1000, in a frame of 100 tiles. A frame of one kind keeps its mean.
    #[test]
    fn one_bright_tile_does_not_decide() {
        let mut image = Array2::<f32>::zeros((40, 40));
        (0..9).for_each(|n| image.slice_mut(s![4 * n..4 * n + 4, 0..4]).fill(10.0));
        let usual = |image: &Array2<f32>| usual_light(image.view(), 4.0, &Tones::new(image.view()), 0.1);
        assert_eq!(usual(&image), 10.0);
        image[[0, 39]] = 1000.0;
        image[[1, 39]] = 1000.0;
        assert_eq!(usual(&image), 10.0);
        assert_eq!(usual(&Array2::zeros((40, 40))), 0.0);
    }
}
