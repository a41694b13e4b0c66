//! The corrections of a frame.

use super::hot::{neighbours, repair};
use crate::mean::check_saturation;
use lf_core::Refusal;
use lf_core::image::{clipped_share, noise};
use lf_core::statistics::median;
use ndarray::Array2;

/// Sensitivity below this share of the usual one is not corrected: the noise would be multiplied.
const LEAST_SENSITIVITY: f32 = 0.2;

/// The corrections that were asked for.
#[derive(Debug, Clone, Default)]
pub struct Correction {
    /// Pixels that are replaced by their neighbours, in rising order.
    pub replaced: Vec<(usize, usize)>,
    /// Sensitivity of the pixels.
    pub sensitivity: Option<Sensitivity>,
    /// Factor of the frames of each laser.
    pub factors: Option<[f64; 2]>,
}

/// Sensitivity of each pixel, 1 where it is usual.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensitivity {
    pixels: Array2<f32>,
    /// Dead pixels (row, column) in rising order: they have less than a fifth of the usual sensitivity, and so has at
    /// most one of their neighbours.
    pub dead: Vec<(usize, usize)>,
    /// Other pixels with as little, such as those behind a mask. They are left as they are.
    pub left: usize,
}

impl Sensitivity {
    /// By an image of even light: its counts over their median. Refuses a saturated image, and one that is dark in half
    /// of its pixels.
    pub fn new(flat: &Array2<f32>) -> Result<Self, Refusal> {
        let mut counts: Vec<f64> = flat.iter().map(|count| f64::from(*count)).collect();
        let usual = median(&mut counts) as f32;
        let found = || format!("half of its pixels have {usual} counts or less");
        Refusal::unless(usual > 0.0, found, "wanted an image of even light on the sensor")?;
        check_saturation(flat)?;
        let is_seen = |count: f32| count > LEAST_SENSITIVITY * usual;
        let is_alone = |place| neighbours(flat.dim(), place).filter(|near| !is_seen(flat[*near])).count() < 2;
        let dark = flat.indexed_iter().filter(|(_, count)| !is_seen(**count)).map(|(place, _)| place);
        let (dead, left): (Vec<_>, Vec<_>) = dark.partition(|place| is_alone(*place));
        let pixels = flat.mapv(|count| if is_seen(count) { count / usual } else { 1.0 });
        Ok(Self { pixels, dead, left: left.len() })
    }
}

/// A frame before and after.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Mean of all pixels, counts.
    pub mean: [f64; 2],
    /// Standard deviation where the frame is darkest, counts.
    pub noise: [f64; 2],
    /// Brightest pixel, counts.
    pub brightest: [f32; 2],
    /// Level, counts, and share of the pixels that were clipped before: see [`clipped_share`].
    pub clipped: Option<(f32, f64)>,
}

impl Correction {
    /// Corrects a frame of laser 0 or 1: first the sensitivity, then the pixels that are replaced, then the light.
    /// Clipped pixels get the largest count, so that the corrected frame is clipped too.
    pub fn apply(&self, frame: &mut Array2<f32>, laser: usize) -> Change {
        let before = Self::figures(frame);
        let clipped = clipped_share(frame.view());
        let level = clipped.map_or(f32::INFINITY, |(level, _)| level);
        let mut raised: Vec<_> =
            frame.indexed_iter().filter(|(_, count)| **count >= level).map(|(place, _)| place).collect();
        raised.retain(|place| self.replaced.binary_search(place).is_err());
        if let Some(sensitivity) = &self.sensitivity {
            frame.zip_mut_with(&sensitivity.pixels, |count, sensitivity| *count /= sensitivity);
        }
        repair(frame, &self.replaced);
        if let Some(factors) = self.factors {
            frame.mapv_inplace(|count| count * factors[laser] as f32);
        }
        let brightest = brightest(frame);
        raised.into_iter().for_each(|place| frame[place] = brightest);
        let after = Self::figures(frame);
        let [mean, noise] = [0, 1].map(|n| [before.0[n], after.0[n]]);
        Change { mean, noise, brightest: [before.1, after.1], clipped }
    }

    /// Mean and noise, and the brightest pixel.
    fn figures(frame: &Array2<f32>) -> ([f64; 2], f32) {
        let mean = frame.iter().map(|count| f64::from(*count)).sum::<f64>() / frame.len() as f64;
        ([mean, noise(frame.view())], brightest(frame))
    }
}

fn brightest(frame: &Array2<f32>) -> f32 {
    frame.iter().fold(0f32, |most, count| most.max(*count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_of_even_light_makes_itself_even() {
        let flat = Array2::from_shape_fn((8, 8), |(y, x)| 100.0 + 10.0 * ((y + x) % 3) as f32);
        let mut frame = flat.mapv(|count| 0.5 * count);
        let correction = Correction { sensitivity: Some(Sensitivity::new(&flat).unwrap()), ..Correction::default() };
        let change = correction.apply(&mut frame, 0);
        assert!(frame.iter().all(|count| (count - 55.0).abs() < 1e-4), "{frame}");
        assert!(change.noise[0] > 1.0 && change.noise[1] < 1e-3, "{change:?}");
    }

    /// Two dead pixels side by side, one at the edge, and a mask over a corner.
    #[test]
    fn dead_pixels_are_replaced_and_a_mask_is_left_as_it_is() {
        let dead = [(0, 9), (5, 5), (5, 6)];
        let is_dark = |place @ (row, column): (usize, usize)| dead.contains(&place) || row + column < 4;
        let flat = Array2::from_shape_fn((12, 12), |place| if is_dark(place) { 0.0 } else { 100.0 });
        let sensitivity = Sensitivity::new(&flat).unwrap();
        assert_eq!((sensitivity.dead.as_slice(), sensitivity.left), (dead.as_slice(), 10));
        let mut frame = flat.mapv(|count| 0.5 * count);
        let replaced = sensitivity.dead.clone();
        Correction { replaced, sensitivity: Some(sensitivity), ..Correction::default() }.apply(&mut frame, 0);
        assert!(dead.iter().all(|place| frame[*place] == 50.0) && frame[(0, 0)] == 0.0, "{frame}");
    }

    #[test]
    fn dark_and_saturated_images_show_no_sensitivity() {
        let half_dark = Array2::from_shape_fn((8, 8), |(_, x)| if x < 5 { 0.0 } else { 100.0 });
        assert_eq!(Sensitivity::new(&half_dark).unwrap_err().found, "half of its pixels have 0 counts or less");
        let saturated = Array2::from_shape_fn((60, 60), |(y, x)| ((y * 60 + x) as f32 % 400.0).min(300.0) + 700.0);
        assert!(Sensitivity::new(&saturated).unwrap_err().found.starts_with("saturated: "));
    }

    #[test]
    fn only_the_second_laser_is_scaled() {
        let correction = Correction { factors: Some([1.0, 1.5]), ..Correction::default() };
        let mut frames = [Array2::from_elem((2, 2), 4.0), Array2::from_elem((2, 2), 4.0)];
        let [first, second] = &mut frames;
        assert_eq!(correction.apply(first, 0).mean, [4.0, 4.0]);
        assert_eq!(correction.apply(second, 1).mean, [4.0, 6.0]);
    }
}
