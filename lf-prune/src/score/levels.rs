//! The image as whole numbers, at most 0, that scores add up; and the rule for keeping a voxel.

use crate::options::{Options, Score};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// A voxel counts as seen if at least this share of the aperture's sections leads to the sensor.
pub(super) const SEEN_SHARE: f64 = 0.5;

/// Levels of a logarithm of 1. The sum over 512 x 512 sections, the most pixels under a lenslet, fits an i32.
const UNIT: f64 = 512.0;

pub(crate) struct Levels<'a> {
    /// [`UNIT`] ln(pixel over the brightest), between two limits; or 0 for a pixel that reaches the threshold and -1
    /// for one that does not. A blind pixel has the threshold's level, so it speaks neither for a voxel nor against it.
    pub(crate) values: Vec<i32>,
    pub(super) width: usize,
    peak: f64,
    options: &'a Options,
}

impl<'a> Levels<'a> {
    /// `peak` is the brightest pixel.
    pub(crate) fn new(image: ArrayView2<f32>, peak: f32, options: &'a Options) -> Self {
        let peak = if peak > 0.0 { f64::from(peak) } else { 1.0 };
        let (height, width) = image.dim();
        let bright = options.bright.max(options.dark);
        let blind = (options.threshold.max(options.dark).ln() * UNIT).ceil() as i32;
        let level = |pixel: &f32| {
            let share = f64::from(*pixel) / peak;
            match options.score {
                Score::Geometric if share.is_nan() => blind,
                Score::Geometric => (share.clamp(options.dark, bright).ln() * UNIT).round() as i32,
                Score::Share(_) if share.is_nan() => 0,
                Score::Share(_) => -i32::from(share < options.threshold || share <= 0.0),
            }
        };
        let mut values = vec![0; height * width];
        values.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, levels)| {
            levels.iter_mut().zip(image.row(y)).for_each(|(value, pixel)| *value = level(pixel));
        });
        Self { values, width, peak, options }
    }

    /// A row of the image. None beside the sensor.
    pub(super) fn row(&self, row: u32) -> Option<&[i32]> {
        self.values.get(row as usize * self.width..)?.get(..self.width)
    }

    /// The least sum of levels with which a voxel is kept, if `seen` of `sections` rays meet the sensor.
    pub(crate) fn least_sum(&self, seen: u32, sections: u32) -> i32 {
        if f64::from(seen) < SEEN_SHARE * f64::from(sections) {
            return i32::MAX;
        }
        if self.options.keep_all {
            return i32::MIN;
        }
        match self.options.score {
            Score::Geometric => {
                let least = self.options.threshold.max(self.options.dark).ln();
                (least * UNIT * f64::from(seen)).ceil() as i32
            }
            Score::Share(dark) => -((dark * f64::from(seen) + 1e-9).floor() as i32),
        }
    }

    /// A voxel's score from the sum of `seen` levels.
    pub(crate) fn score(&self, sum: i32, seen: u32) -> f32 {
        let mean = f64::from(sum) / f64::from(seen.max(1));
        match self.options.score {
            Score::Geometric => (self.peak * (mean / UNIT).exp()) as f32,
            Score::Share(_) => (1.0 + mean) as f32,
        }
    }
}
