//! A rectangle of each camera's sensor: the image there, and the light that is expected.

use crate::cameras::noise::Noise;
use crate::cameras::view::{CameraView, Cameras};
use lf_core::particle_image::Patch;

/// A rectangle of each sensor, one below the other. All rows are equally long; pixels beyond the end of a rectangle are
/// blind.
#[derive(Debug, Clone)]
pub(crate) struct Window {
    /// Length of a row.
    pub(crate) columns: usize,
    /// The rectangle of each camera.
    pub(crate) parts: Vec<Part>,
    /// Counts of the images; NaN where a pixel is blind.
    pub(crate) seen: Vec<f32>,
    /// Counts that particles are expected to put there.
    pub(crate) light: Vec<f32>,
}

/// A rectangle of one camera's sensor, and where its pixels begin in the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Part {
    pub(crate) left: usize,
    pub(crate) top: usize,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    pub(crate) start: usize,
}

impl Part {
    /// The row and the column of the sensor on which pixel `n` of a patch lies; None outside the rectangle.
    pub(crate) fn place(&self, patch: &Patch, n: usize) -> Option<(usize, usize)> {
        let (row, column) =
            (patch.row as usize + n / patch.columns as usize, patch.column as usize + n % patch.columns as usize);
        let is_in =
            (self.left..self.left + self.columns).contains(&column) && (self.top..self.top + self.rows).contains(&row);
        is_in.then_some((row, column))
    }
}

/// First and end column and row.
pub(crate) type Rectangle = [[usize; 2]; 2];

impl Window {
    /// A rectangle of each camera's image, and of the light expected on it.
    pub(crate) fn cut(views: &[CameraView], rectangles: &[Rectangle]) -> Self {
        let columns = rectangles.iter().map(|[low, high]| high[0] - low[0]).max().unwrap_or(0);
        let mut window = Self { columns, parts: Vec::new(), seen: Vec::new(), light: Vec::new() };
        for (view, [low, high]) in views.iter().zip(rectangles) {
            let (start, width) = (window.seen.len(), view.image.ncols());
            let part = Part { left: low[0], top: low[1], columns: high[0] - low[0], rows: high[1] - low[1], start };
            let image = view.image.slice(ndarray::s![low[1]..high[1], low[0]..high[0]]);
            window.seen.reserve_exact(columns * part.rows);
            window.light.reserve_exact(columns * part.rows);
            for (n, row) in image.rows().into_iter().enumerate() {
                let end = start + (n + 1) * columns;
                let line = (low[1] + n) * width;
                window.seen.extend(row);
                window.seen.resize(end, f32::NAN);
                window.light.extend_from_slice(&view.expected[line + low[0]..line + high[0]]);
                window.light.resize(end, 0.0);
            }
            window.parts.push(part);
        }
        window
    }

    /// The number of the camera that sees a pixel of the window.
    #[inline(always)]
    pub(crate) fn camera_of(&self, pixel: usize) -> usize {
        self.parts[1..].iter().take_while(|part| pixel >= part.start).count()
    }

    /// The noise of the camera that sees a pixel of the window.
    #[inline(always)]
    pub(crate) fn noise<'c>(&self, cameras: &'c Cameras, pixel: usize) -> &'c Noise {
        &cameras.views[self.camera_of(pixel)].noise
    }

    /// Visits each row of the window's light beside that of the sensors.
    pub(crate) fn onto(&self, views: &mut [CameraView], put: impl Fn(&mut [f32], &[f32])) {
        for (view, part) in views.iter_mut().zip(&self.parts) {
            let width = view.image.ncols();
            for row in 0..part.rows {
                let start = (part.top + row) * width + part.left;
                let line = &self.light[part.start + row * self.columns..][..part.columns];
                put(&mut view.expected[start..start + part.columns], line);
            }
        }
    }
}
