use crate::statistics::ranked;
use ndarray::ArrayView2;
use rayon::prelude::*;

/// About this many pixels, spread evenly over the image, give the tones.
const SAMPLE: usize = 1 << 20;

/// Pixels below this share of the light's brightness count as dark: they may be noise.
pub(super) const DARKEST: f64 = 0.1;

/// How bright a frame is, in counts. Blind pixels, which are NaN, do not count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tones {
    /// Mean brightness of the light itself, sum I^2 / sum I. It grows with the overlap of particle images and not with
    /// the size of the image, as its brightest pixel does. 0 for a black image.
    pub light: f64,
    /// A thousandth of the pixels are brighter: hot pixels are fewer.
    pub bright: f64,
    /// Half of the pixels are darker.
    pub middle: f64,
    /// A tenth of the pixels are darker.
    pub dark: f64,
    /// A hundredth of the pixels are darker.
    pub darkest: f64,
    /// The brightest pixel.
    pub peak: f64,
}

impl Tones {
    /// The tones of an image of shape (height, width) without negative values.
    pub fn new(image: ArrayView2<f32>) -> Self {
        let rows: Vec<_> = (0..image.nrows()).into_par_iter().map(|row| sums(image.row(row).iter())).collect();
        let add = |a: [f64; 3], b: [f64; 3]| [a[0] + b[0], a[1] + b[1], a[2].max(b[2])];
        let [light, squares, peak] = rows.into_iter().fold([0.0; 3], add);
        let step = image.len() / SAMPLE + 1;
        let mut sample: Vec<f32> = image.iter().step_by(step).copied().filter(|value| !value.is_nan()).collect();
        let [bright, middle, dark, darkest] = [0.999, 0.5, 0.1, 0.01].map(|share| {
            let rank = (share * sample.len() as f64) as usize;
            ranked(&mut sample, rank).map_or(0.0, f64::from)
        });
        Self { light: if light > 0.0 { squares / light } else { 0.0 }, bright, middle, dark, darkest, peak }
    }
}

/// Sum, sum of squares and maximum.
fn sums<'a>(values: impl Iterator<Item = &'a f32>) -> [f64; 3] {
    values.filter(|value| !value.is_nan()).fold([0.0; 3], |[sum, squares, peak], value| {
        let value = f64::from(*value);
        [sum + value, squares + value * value, peak.max(value)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// By hand: a pixel of 0, 79 of 1, 19 of 10, one of 100, and a blind one.
    #[test]
    fn tones_by_hand() {
        let mut image = Array2::from_elem((1, 101), 1.0f32);
        (0..19).for_each(|n| image[[0, n]] = 10.0);
        (image[[0, 50]], image[[0, 60]], image[[0, 70]]) = (100.0, f32::NAN, 0.0);
        let light = (79.0 + 1900.0 + 10000.0) / (79.0 + 190.0 + 100.0);
        assert_eq!(
            Tones::new(image.view()),
            Tones { light, bright: 100.0, middle: 1.0, dark: 1.0, darkest: 1.0, peak: 100.0 }
        );
        image[[0, 71]] = 0.0;
        assert_eq!(Tones::new(image.view()).darkest, 0.0);
        let black = Tones { light: 0.0, bright: 0.0, middle: 0.0, dark: 0.0, darkest: 0.0, peak: 0.0 };
        assert_eq!(Tones::new(Array2::zeros((5, 5)).view()), black);
        assert_eq!(Tones::new(Array2::from_elem((2, 2), f32::NAN).view()), black);
    }
}
