//! The mean of frames.

use crate::white::mean::other_size;
use lf_core::Refusal;
use ndarray::Array2;

/// A mean in the making. It holds one plane of sums.
#[derive(Debug, Clone, Default)]
pub struct MeanBackground {
    sums: Option<Array2<f64>>,
    frames: usize,
}

impl MeanBackground {
    /// Adds a frame. Refuses another size than that of the first one.
    pub fn add(&mut self, frame: &Array2<f32>) -> Result<(), Refusal> {
        let sums = self.sums.get_or_insert_with(|| Array2::zeros(frame.dim()));
        if sums.dim() != frame.dim() {
            return Err(other_size(frame, sums.dim()));
        }
        sums.zip_mut_with(frame, |sum, count| *sum += f64::from(*count));
        self.frames += 1;
        Ok(())
    }

    /// The mean of the frames that were added. None if there were none.
    pub fn finish(self) -> Option<Array2<f32>> {
        let share = 1.0 / self.frames as f64;
        self.sums.map(|sums| sums.mapv(|sum| (share * sum) as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_two_frames() {
        let mut mean = MeanBackground::default();
        assert!(mean.clone().finish().is_none());
        mean.add(&Array2::from_elem((2, 3), 1.0)).unwrap();
        mean.add(&Array2::from_elem((2, 3), 4.0)).unwrap();
        assert_eq!(mean.add(&Array2::zeros((3, 2))).unwrap_err().wanted, "wanted 3 x 2 px like the first");
        assert_eq!(mean.finish(), Some(Array2::from_elem((2, 3), 2.5)));
    }
}
