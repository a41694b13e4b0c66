//! The mean of several images, and what each of them must satisfy.

use lf_core::{Refusal, image::clipped_share};
use ndarray::Array2;

/// Largest share of pixels that are clipped.
const MOST_SATURATED: f64 = 0.02;

/// Images, summed one after another. Memory does not grow with their number.
#[derive(Debug, Clone, Default)]
pub struct MeanImage {
    sum: Option<Array2<f64>>,
    count: usize,
}

impl MeanImage {
    /// Adds an image of counts. Refuses another size than that of the first image.
    pub fn add(&mut self, image: &Array2<f32>) -> Result<(), Refusal> {
        let sum = self.sum.get_or_insert_with(|| Array2::zeros(image.dim()));
        if sum.dim() != image.dim() {
            return Err(other_size(image, sum.dim()));
        }
        sum.zip_mut_with(image, |sum, &value| *sum += value as f64);
        self.count += 1;
        Ok(())
    }

    /// The mean image. None if no image was added.
    pub fn mean(self) -> Option<Array2<f32>> {
        let count = self.count as f64;
        self.sum.filter(|_| self.count > 0).map(|sum| sum.mapv(|sum| (sum / count) as f32))
    }
}

/// Refuses an image that is not (height, width) like the ones before it.
pub(crate) fn other_size(image: &Array2<f32>, (height, width): (usize, usize)) -> Refusal {
    Refusal::new(
        format!("image of {} x {} px", image.ncols(), image.nrows()),
        format!("wanted {width} x {height} px like the first"),
    )
}

/// Refuses too many clipped pixels if every count is a whole number: an image that was drawn may have flat tops.
pub fn check_saturation(image: &Array2<f32>) -> Result<(), Refusal> {
    let clipped = clipped_share(image.view()).filter(|(_, share)| *share > MOST_SATURATED);
    match clipped {
        Some((level, share)) if image.iter().all(|value| value.fract() == 0.0) => Err(Refusal::new(
            format!("saturated: {:.0} % of the pixels are at {level}, the highest count", 100.0 * share),
            format!("wanted at most {:.0} %", 100.0 * MOST_SATURATED),
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_exact_and_sizes_must_match() {
        let mut mean = MeanImage::default();
        mean.add(&Array2::from_elem((2, 3), 1.0)).unwrap();
        mean.add(&Array2::from_elem((2, 3), 4.0)).unwrap();
        let refusal = mean.add(&Array2::from_elem((3, 2), 1.0)).unwrap_err();
        assert_eq!(refusal.found, "image of 2 x 3 px");
        assert_eq!(refusal.wanted, "wanted 3 x 2 px like the first");
        assert_eq!(mean.mean().unwrap(), Array2::from_elem((2, 3), 2.5));
        assert!(MeanImage::default().mean().is_none());
    }

    #[test]
    fn a_pile_of_whole_numbers_at_any_level_is_saturation_and_a_flat_top_is_not() {
        let image = Array2::from_shape_fn((40, 40), |(row, column)| (40 * row + column) as f32 % 800.0);
        for (limit, scale) in [(400.0, 1.0), (600.0, 16.0), (790.0, 5.0)] {
            let clipped = image.mapv(|value| value.min(limit) * scale);
            let share = (800.0 - limit) / 8.0;
            let wanted = format!("saturated: {share:.0} % of the pixels are at {}, the highest count", limit * scale);
            match check_saturation(&clipped) {
                Err(refusal) => assert_eq!(refusal.found, wanted),
                Ok(()) => assert!(share < 2.0, "{limit}"),
            }
            assert!(check_saturation(&clipped.mapv(|value| value * 0.9 + 0.5)).is_ok());
        }
        assert!(check_saturation(&image).is_ok());
    }
}
