//! A rectangle of the sensor: what is seen there, and the light of particles. With several cameras, one of each.

use ndarray::ArrayView2;

/// A rectangle of pixels, row by row. Rectangles of further cameras follow; all rows are equally long, and pixels
/// beyond a rectangle's end are blind.
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
    /// Columns of the first rectangle: a row may be longer.
    width: usize,
    /// Rectangles of further cameras.
    pub(super) further: Vec<Part>,
}

/// A rectangle of one camera's sensor, and where its pixels begin in the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Part {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) start: usize,
}

/// First and end column and row.
pub(super) type Rectangle = [[usize; 2]; 2];

/// An image and the light that particles are expected to put there.
pub(super) type Sheet<'a> = (ArrayView2<'a, f32>, &'a [f32]);

impl Window {
    /// The part of the image, and of the light on it, from `low` up to `high` (column, row), excluded.
    pub(super) fn cut(image: ArrayView2<f32>, light: &[f32], low: [usize; 2], high: [usize; 2]) -> Self {
        let width = image.ncols();
        let (columns, rows) = (high[0] - low[0], high[1] - low[1]);
        let part = ndarray::s![low[1]..high[1], low[0]..high[0]];
        let seen = image.slice(part).iter().copied().collect();
        let row = |row: usize| &light[row * width + low[0]..row * width + high[0]];
        let light = (low[1]..high[1]).flat_map(|n| row(n).iter().copied()).collect();
        Self { left: low[0], top: low[1], columns, rows, seen, light, width: columns, further: Vec::new() }
    }

    /// Rectangles of several cameras, the first camera's first.
    pub(super) fn cut_all(sheets: &[(Sheet, Rectangle)]) -> Self {
        let wide = |(_, [low, high]): &(Sheet, Rectangle)| high[0] - low[0];
        let columns = sheets.iter().map(wide).max().unwrap_or(0);
        let (mut seen, mut light, mut parts) = (Vec::new(), Vec::new(), Vec::new());
        for ((image, expected), [low, high]) in sheets {
            let part = Self::cut(*image, expected, *low, *high);
            let start = seen.len();
            parts.push(Part { left: low[0], top: low[1], columns: part.columns, rows: part.rows, start });
            for row in 0..part.rows {
                let line = row * part.columns..(row + 1) * part.columns;
                seen.extend_from_slice(&part.seen[line.clone()]);
                light.extend_from_slice(&part.light[line]);
                seen.resize(start + (row + 1) * columns, f32::NAN);
                light.resize(start + (row + 1) * columns, 0.0);
            }
        }
        let Part { left, top, columns: width, rows, .. } = parts.remove(0);
        Self { left, top, columns, rows, seen, light, width, further: parts }
    }

    /// The rectangle of a camera; 0 is the first.
    pub(super) fn part(&self, camera: usize) -> Part {
        let Self { left, top, rows, width, .. } = *self;
        match camera {
            0 => Part { left, top, columns: width, rows, start: 0 },
            n => self.further[n - 1],
        }
    }

    /// The camera that a pixel of the window is of.
    #[inline(always)]
    pub(super) fn camera_of(&self, pixel: usize) -> usize {
        self.further.iter().take_while(|part| pixel >= part.start).count()
    }

    /// Puts the light of a camera back onto its sensor.
    pub(super) fn paste(&self, camera: usize, light: &mut [f32], width: usize) {
        let part = self.part(camera);
        for row in 0..part.rows {
            let line = &self.light[part.start + row * self.columns..][..part.columns];
            let start = (part.top + row) * width + part.left;
            light[start..start + part.columns].copy_from_slice(line);
        }
    }

    /// Adds the light to that on a camera's sensor.
    pub(super) fn add_to(&self, camera: usize, light: &mut [f32], width: usize) {
        let part = self.part(camera);
        for row in 0..part.rows {
            let line = &self.light[part.start + row * self.columns..][..part.columns];
            let start = (part.top + row) * width + part.left;
            light[start..start + part.columns].iter_mut().zip(line).for_each(|(sum, value)| *sum += value);
        }
    }
}
