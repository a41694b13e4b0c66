//! Hot pixels: those that stand above their neighbours in every frame.

use lf_core::statistics::{median, robust};
use ndarray::Array2;
use rayon::prelude::*;

/// Smallest number of frames that show hot pixels: fewer may show the same particles.
const LEAST_FRAMES: usize = 5;
/// Pixels from which the scatter is taken, at most.
const SAMPLE: usize = 200_000;
/// Neighbours of a pixel, at most.
const NEIGHBOURS: usize = 8;
/// Smallest height that counts, counts: whole numbers without noise have no scatter.
const LEAST_COUNTS: f64 = 1.0;

/// The search; frames are added one after another.
#[derive(Debug, Clone, Default)]
pub struct HotPixels {
    /// Smallest height of each pixel above the median of its neighbours.
    least: Option<Array2<f32>>,
    frames: usize,
}

impl HotPixels {
    /// Smallest number of frames that must be added.
    pub const LEAST_FRAMES: usize = LEAST_FRAMES;

    /// Adds a frame. All have one size.
    pub fn add(&mut self, frame: &Array2<f32>) {
        let heights = heights(frame);
        match &mut self.least {
            Some(least) => least.zip_mut_with(&heights, |least, height| *least = least.min(*height)),
            None => self.least = Some(heights),
        }
        self.frames += 1;
    }

    /// The pixels (row, column) that are higher than the others' by more than `limit` robust standard deviations. None
    /// of fewer than [`HotPixels::LEAST_FRAMES`].
    pub fn find(&self, limit: f64) -> Option<Vec<(usize, usize)>> {
        let least = self.least.as_ref().filter(|_| self.frames >= LEAST_FRAMES)?;
        let step = least.len().div_ceil(SAMPLE);
        let sample: Vec<f64> = least.iter().step_by(step).map(|height| f64::from(*height)).collect();
        let (middle, scatter) = robust(&sample);
        let most = (middle + (limit * scatter).max(LEAST_COUNTS)) as f32;
        Some(least.indexed_iter().filter(|(_, height)| **height > most).map(|(place, _)| place).collect())
    }
}

/// The height of each pixel above the median of its neighbours.
fn heights(frame: &Array2<f32>) -> Array2<f32> {
    let (height, width) = frame.dim();
    let values = (0..height * width).into_par_iter().with_min_len(4096);
    let values = values.map(|n| {
        let place = (n / width, n % width);
        frame[place] - around(frame, place, |_| true).unwrap_or(frame[place])
    });
    Array2::from_shape_vec((height, width), values.collect()).expect("as many values as pixels")
}

/// The pixels about one, up to eight.
pub(super) fn neighbours(
    (height, width): (usize, usize),
    (row, column): (usize, usize),
) -> impl Iterator<Item = (usize, usize)> {
    let rows = row.saturating_sub(1)..(row + 2).min(height);
    let columns = column.saturating_sub(1)..(column + 2).min(width);
    let places = rows.flat_map(move |row| columns.clone().map(move |column| (row, column)));
    places.filter(move |place| *place != (row, column))
}

/// The median of the neighbours of a pixel that count. None if none does.
fn around(frame: &Array2<f32>, place: (usize, usize), counts: impl Fn((usize, usize)) -> bool) -> Option<f32> {
    let places = neighbours(frame.dim(), place).filter(|near| counts(*near));
    let (mut values, mut count) = ([0.0; NEIGHBOURS], 0);
    for place in places {
        values[count] = f64::from(frame[place]);
        count += 1;
    }
    (count > 0).then(|| median(&mut values[..count]) as f32)
}

/// Replaces hot and dead pixels by the median of their neighbours that are neither; without such neighbours by 0.
pub(super) fn repair(frame: &mut Array2<f32>, hot: &[(usize, usize)]) {
    let is_hot = |place: (usize, usize)| hot.binary_search(&place).is_ok();
    let repaired: Vec<f32> =
        hot.iter().map(|place| around(frame, *place, |near| !is_hot(near)).unwrap_or(0.0)).collect();
    hot.iter().zip(repaired).for_each(|(place, value)| frame[*place] = value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::uniform;

    /// Noise about 10 with a particle that moves, and a hot pixel at (3, 4).
    fn frame(n: usize) -> Array2<f32> {
        let mut state = n as u64 + 1;
        let mut frame = Array2::from_shape_fn((12, 12), |_| 10.0 + uniform(&mut state) as f32);
        frame[(6, n)] += 200.0;
        frame[(3, 4)] += 40.0;
        frame
    }

    #[test]
    fn a_pixel_that_is_high_in_every_frame_is_hot_and_a_particle_is_not() {
        let mut search = HotPixels::default();
        for n in 0..LEAST_FRAMES {
            assert_eq!(search.find(12.0), None, "{n} frames are too few");
            search.add(&frame(n));
        }
        let hot = search.find(12.0).unwrap();
        assert_eq!(hot, [(3, 4)]);
        let mut repaired = frame(2);
        repair(&mut repaired, &hot);
        assert!((9.0..12.0).contains(&repaired[(3, 4)]) && repaired[(6, 2)] > 200.0);
    }

    #[test]
    fn hot_neighbours_do_not_repair_each_other() {
        let mut frame = Array2::from_elem((3, 3), 2.0);
        (frame[(0, 0)], frame[(0, 1)]) = (100.0, 100.0);
        repair(&mut frame, &[(0, 0), (0, 1)]);
        assert_eq!(frame, Array2::from_elem((3, 3), 2.0));
    }
}
