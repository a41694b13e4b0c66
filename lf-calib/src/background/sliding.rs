//! The minimum over the frames about each frame, for a background that changes slowly.

use crate::mean::other_size;
use lf_core::Refusal;
use ndarray::Array2;
use std::collections::VecDeque;

/// A sliding minimum. It holds the frames of one window.
#[derive(Debug, Clone)]
pub struct SlidingMinimum {
    reach: usize,
    frames: VecDeque<Array2<f32>>,
    added: usize,
    given: usize,
}

impl SlidingMinimum {
    /// Minima over a frame and `reach` frames before and after it; over fewer at both ends.
    pub fn new(reach: usize) -> Self {
        Self { reach, frames: VecDeque::new(), added: 0, given: 0 }
    }

    /// Adds a frame. Gives the background of the frame that is `reach` frames earlier, if there is one. Refuses another
    /// size than that of the first.
    pub fn add(&mut self, frame: Array2<f32>) -> Result<Option<Array2<f32>>, Refusal> {
        if let Some(first) = self.frames.front().filter(|first| first.dim() != frame.dim()) {
            return Err(other_size(&frame, first.dim()));
        }
        if self.frames.len() > 2 * self.reach {
            self.frames.pop_front();
        }
        self.frames.push_back(frame);
        self.added += 1;
        Ok((self.added > self.reach).then(|| self.minimum()).flatten())
    }

    /// The background of the next frame after the last was added. None when every frame has one.
    pub fn rest(&mut self) -> Option<Array2<f32>> {
        if self.given == self.added {
            return None;
        }
        // The window reaches back from the frame whose turn it is.
        let first = self.given.saturating_sub(self.reach);
        while self.added - self.frames.len() < first {
            self.frames.pop_front();
        }
        self.minimum()
    }

    fn minimum(&mut self) -> Option<Array2<f32>> {
        self.given += 1;
        let mut frames = self.frames.iter();
        let mut lowest = frames.next()?.clone();
        frames.for_each(|frame| lowest.zip_mut_with(frame, |lowest, count| *lowest = lowest.min(*count)));
        Some(lowest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The backgrounds of frames of one pixel.
    fn minima(counts: &[f32], reach: usize) -> Vec<f32> {
        let mut sliding = SlidingMinimum::new(reach);
        let mut found = Vec::new();
        for count in counts {
            found.extend(sliding.add(Array2::from_elem((1, 1), *count)).unwrap());
        }
        found.extend(std::iter::from_fn(|| sliding.rest()));
        found.iter().map(|frame| frame[(0, 0)]).collect()
    }

    #[test]
    fn every_frame_has_the_minimum_of_its_window() {
        let counts = [5.0, 3.0, 4.0, 8.0, 7.0, 9.0];
        assert_eq!(minima(&counts, 1), [3.0, 3.0, 3.0, 4.0, 7.0, 7.0]);
        assert_eq!(minima(&counts, 2), [3.0, 3.0, 3.0, 3.0, 4.0, 7.0]);
        assert_eq!(minima(&counts, 9), [3.0; 6]);
        assert_eq!(minima(&counts[..1], 2), [5.0]);
    }

    #[test]
    fn sizes_must_match() {
        let mut sliding = SlidingMinimum::new(1);
        sliding.add(Array2::zeros((4, 5))).unwrap();
        assert_eq!(sliding.add(Array2::zeros((5, 4))).unwrap_err().wanted, "wanted 5 x 4 px like the first");
    }
}
