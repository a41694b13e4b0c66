//! The background: what stays in every frame. For each pixel it is the minimum or a low quantile over many frames.

use crate::mean::other_size;
use lf_core::Refusal;
use ndarray::Array2;
use rayon::prelude::*;

/// A background in the making; frames are added one after another.
///
/// The quantile q of n frames lies between the sorted counts number floor(q (n - 1)) and the next one, counted from 0,
/// with linear interpolation; q = 0 is the minimum. Only the counts up to there are kept: one plane for the minimum,
/// whatever the number of frames, and floor(q (n - 1)) + 2 planes for a quantile.
#[derive(Debug, Clone)]
pub struct Background {
    quantile: f64,
    planes: usize,
    frames: usize,
    shape: Option<(usize, usize)>,
    /// The lowest counts of each pixel in rising order, `planes` for each pixel.
    lowest: Vec<f32>,
}

impl Background {
    /// Bytes of a background of at most this many frames of `pixels` pixels.
    pub fn bytes(frames: usize, quantile: f64, pixels: f64) -> f64 {
        size_of::<f32>() as f64 * Self::planes(frames, quantile) as f64 * pixels
    }

    fn planes(frames: usize, quantile: f64) -> usize {
        (quantile * (frames - 1) as f64).ceil() as usize + 1
    }

    /// A background of at most this many frames. Panics without frames, or with a quantile outside 0 to 1.
    pub fn new(frames: usize, quantile: f64) -> Self {
        assert!(frames > 0 && (0.0..=1.0).contains(&quantile));
        Self { quantile, planes: Self::planes(frames, quantile), frames: 0, shape: None, lowest: Vec::new() }
    }

    /// Adds a frame. Refuses another size than that of the first one.
    pub fn add(&mut self, frame: &Array2<f32>) -> Result<(), Refusal> {
        let shape = *self.shape.get_or_insert(frame.dim());
        if shape != frame.dim() {
            return Err(other_size(frame, shape));
        }
        if self.lowest.is_empty() {
            self.lowest = vec![f32::INFINITY; frame.len() * self.planes];
        }
        let frame = frame.as_standard_layout();
        let counts = frame.as_slice().expect("a standard layout is one slice");
        // Insert into a short sorted list. A count that falls off its end is never needed again.
        self.lowest.par_chunks_mut(self.planes).zip(counts).with_min_len(4096).for_each(|(lowest, &count)| {
            let mut count = count;
            for kept in lowest.iter_mut() {
                if count < *kept {
                    std::mem::swap(kept, &mut count);
                }
            }
        });
        self.frames += 1;
        Ok(())
    }

    /// The background of the frames that were added, which may be fewer than announced. None if there were none.
    pub fn finish(self) -> Option<Array2<f32>> {
        let position = self.quantile * self.frames.checked_sub(1)? as f64;
        let (below, share) = (position.floor() as usize, position.fract() as f32);
        let values = self
            .lowest
            .par_chunks(self.planes)
            .map(|lowest| {
                // At a share of 0 the next count may be infinity, and 0 times infinity is NaN.
                let above = if share > 0.0 { lowest[below + 1] } else { lowest[below] };
                lowest[below] + share * (above - lowest[below])
            })
            .collect();
        Array2::from_shape_vec(self.shape?, values).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frame n of pixel p holds (7 n + p) mod 11: the values 0 to 10 once each, in another order for each pixel.
    fn frames() -> Vec<Array2<f32>> {
        (0..11)
            .map(|n| Array2::from_shape_fn((4, 5), |(row, column)| ((7 * n + 5 * row + column) % 11) as f32))
            .collect()
    }

    fn background(quantile: f64) -> Array2<f32> {
        let mut background = Background::new(11, quantile);
        frames().iter().for_each(|frame| background.add(frame).unwrap());
        background.finish().unwrap()
    }

    #[test]
    fn quantiles_of_eleven_known_counts() {
        for (quantile, expected) in [(0.0, 0.0), (0.05, 0.5), (0.1, 1.0), (0.25, 2.5), (0.5, 5.0), (1.0, 10.0)] {
            let found = background(quantile);
            assert!(found.iter().all(|value| (value - expected).abs() < 1e-6), "{quantile}: {found}");
        }
    }

    #[test]
    fn the_minimum_keeps_one_plane_for_any_number_of_frames() {
        assert_eq!(Background::new(1_000_000, 0.0).planes, 1);
        assert_eq!(Background::new(1001, 0.05).planes, 51);
    }

    #[test]
    fn fewer_frames_than_announced_give_the_same_background() {
        for quantile in [0.0, 0.07, 0.25, 0.5] {
            let mut background = Background::new(40, quantile);
            frames().iter().for_each(|frame| background.add(frame).unwrap());
            assert_eq!(background.finish(), Some(self::background(quantile)));
            let mut one = Background::new(40, quantile);
            one.add(&frames()[3]).unwrap();
            assert_eq!(one.finish().as_ref(), Some(&frames()[3]));
        }
    }

    #[test]
    fn sizes_must_match() {
        let mut background = Background::new(2, 0.0);
        background.add(&Array2::zeros((4, 5))).unwrap();
        assert_eq!(background.add(&Array2::zeros((5, 4))).unwrap_err().wanted, "wanted 5 x 4 px like the first");
        assert!(Background::new(2, 0.0).finish().is_none());
    }
}
