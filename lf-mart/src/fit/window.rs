//! A rectangle of the sensor: what is seen there, and the light of particles.

use ndarray::ArrayView2;

/// A rectangle of pixels, row by row.
#[derive(Debug, Clone)]
pub(super) struct Window {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Counts of the image; NaN where a pixel is blind.
    pub(super) seen: Vec<f32>,
    /// Counts that particles are expected to put there.
    pub(super) light: Vec<f32>,
}

impl Window {
    /// The part of the image, and of the light on it, from `low` up to `high` (column, row), excluded.
    pub(super) fn cut(image: ArrayView2<f32>, light: &[f32], low: [usize; 2], high: [usize; 2]) -> Self {
        let width = image.ncols();
        let (columns, rows) = (high[0] - low[0], high[1] - low[1]);
        let part = ndarray::s![low[1]..high[1], low[0]..high[0]];
        let seen = image.slice(part).iter().copied().collect();
        let row = |row: usize| &light[row * width + low[0]..row * width + high[0]];
        let light = (low[1]..high[1]).flat_map(|n| row(n).iter().copied()).collect();
        Self { left: low[0], top: low[1], columns, rows, seen, light }
    }

    /// Puts the light back onto the sensor.
    pub(super) fn paste(&self, light: &mut [f32], width: usize) {
        for (row, line) in self.light.chunks(self.columns).enumerate() {
            let start = (self.top + row) * width + self.left;
            light[start..start + self.columns].copy_from_slice(line);
        }
    }

    /// Adds the light to that on the sensor.
    pub(super) fn add_to(&self, light: &mut [f32], width: usize) {
        for (row, line) in self.light.chunks(self.columns).enumerate() {
            let start = (self.top + row) * width + self.left;
            light[start..start + self.columns].iter_mut().zip(line).for_each(|(sum, value)| *sum += value);
        }
    }
}
