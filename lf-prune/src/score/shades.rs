//! Shades: how dark each pixel is, as whole numbers that add up to scores. Also the rule for keeping a voxel.

use crate::options::{PruneOptions, Score};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// A voxel counts as seen if at least this share of the aperture's sections leads to the sensor.
const SEEN_SHARE: f64 = 0.5;

/// Tolerance of a limit for rounding, shades.
const ROUNDING: f64 = 1e-6;

pub(crate) struct Shades<'a> {
    /// Shade of each pixel. For a geometric mean, 0 at the bright limit and `darkest` at the dark limit, linear in the
    /// logarithm. For a share, 1 below the threshold and 0 above. A blind pixel counts neither for a voxel nor against.
    pub(super) values: Vec<u8>,
    pub(super) width: usize,
    /// Shades from the bright limit to the dark limit.
    darkest: f64,
    /// Logarithm of the dark limit less that of the bright limit.
    range: f64,
    /// Shade of the threshold.
    limit: f64,
    peak: f64,
    options: &'a PruneOptions,
}

impl<'a> Shades<'a> {
    /// `peak` is the brightest pixel. The sum of shades over `sections` fits 16 bits.
    pub(crate) fn new(image: ArrayView2<f32>, peak: f32, sections: u32, options: &'a PruneOptions) -> Self {
        let peak = if peak > 0.0 { f64::from(peak) } else { 1.0 };
        let (height, width) = image.dim();
        let darkest = f64::from((u32::from(u16::MAX) / sections.max(1)).min(u32::from(u8::MAX)));
        let bright = options.bright.max(options.dark);
        // Keep the range off 0, so that equal limits give equal shades.
        let range = (options.dark.ln() - bright.ln()).min(-1e-9);
        let shade = |share: f64| darkest / range * (share.ln() - bright.ln());
        let limit = shade(options.threshold.max(options.dark));
        let value = |pixel: &f32| {
            let share = f64::from(*pixel) / peak;
            match options.score {
                Score::Geometric if share.is_nan() => limit.max(0.0) as u8,
                Score::Geometric => (shade(share.clamp(options.dark, bright)) + 0.5) as u8,
                Score::Share(_) => u8::from(share < options.threshold || share <= 0.0),
            }
        };
        let mut values = vec![0; height * width];
        values.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, shades)| {
            shades.iter_mut().zip(image.row(y)).for_each(|(shade, pixel)| *shade = value(pixel));
        });
        Self { values, width, darkest, range, limit, peak, options }
    }

    #[cfg(test)]
    pub(crate) fn values(&self) -> &[u8] {
        &self.values
    }

    /// The largest sum of shades of a voxel that is kept, if `seen` of `sections` rays meet the sensor. Negative if no
    /// voxel is kept.
    pub(crate) fn most(&self, seen: u32, sections: u32) -> i32 {
        if f64::from(seen) < SEEN_SHARE * f64::from(sections) {
            return -1;
        }
        if self.options.keep_all {
            return i32::MAX;
        }
        match self.options.score {
            Score::Geometric => (self.limit * f64::from(seen) + ROUNDING).floor() as i32,
            Score::Share(dark) => (dark * f64::from(seen) + ROUNDING).floor() as i32,
        }
    }

    /// A voxel's score from the sum of `seen` shades.
    pub(crate) fn score(&self, sum: u32, seen: u32) -> f32 {
        let mean = f64::from(sum) / f64::from(seen.max(1));
        match self.options.score {
            Score::Geometric => {
                let bright = self.options.bright.max(self.options.dark);
                (self.peak * bright * (mean / self.darkest * self.range).exp()) as f32
            }
            Score::Share(_) => (1.0 - mean) as f32,
        }
    }
}
