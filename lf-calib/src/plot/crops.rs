//! Magnified pieces of the white image: the four corners and the middle.

use super::{Area, Drawn, INK, KEPT, LEFT_OUT, ROOM, TEXT_PX, cross, text, words};
use crate::Calibrated;
use ndarray::{Array2, s};
use plotters::prelude::*;

/// Side of a piece, canvas pixels, and cells along it at most: finer ones would make the file large.
const SIDE: i32 = 224;
const CELLS: usize = 56;
/// Side of a piece in pitches.
const PITCHES: f64 = 4.0;
/// Grey levels that are told apart: neighbours of one level are drawn as one.
const LEVELS: f32 = 40.0;

/// The pieces: their names, and their first pixels (column, row).
pub(super) struct Crops {
    corners: Vec<(&'static str, [usize; 2])>,
    side_px: usize,
}

impl Crops {
    pub fn new(white: &Array2<f32>, pitch_px: f64) -> Self {
        let (height, width) = white.dim();
        let side_px = ((PITCHES * pitch_px).ceil() as usize).clamp(1, width.min(height));
        let (right, low) = (width - side_px, height - side_px);
        let corners = vec![
            ("top left", [0, 0]),
            ("top right", [right, 0]),
            ("middle", [right / 2, low / 2]),
            ("bottom left", [0, low]),
            ("bottom right", [right, low]),
        ];
        Self { corners, side_px }
    }

    pub fn width(&self) -> i32 {
        let count = self.corners.len() as i32;
        count * SIDE + (count - 1) * ROOM / 2
    }

    pub fn height(&self) -> i32 {
        SIDE + TEXT_PX + 8
    }

    pub fn draw(&self, area: &Area, [left, top]: [i32; 2], white: &Array2<f32>, calibrated: &Calibrated) -> Drawn<()> {
        for (n, (name, corner)) in self.corners.iter().enumerate() {
            let place = [left + n as i32 * (SIDE + ROOM / 2), top];
            self.cells(area, place, white, *corner)?;
            let [x, y] = corner.map(|first| first as f64);
            let scale = f64::from(SIDE) / self.side_px as f64;
            for lenslet in &calibrated.residuals {
                let fitted = [0, 1].map(|axis| lenslet.place_px[axis] - lenslet.residual_px[axis]);
                let on_canvas = [(fitted[0] - x) * scale, (fitted[1] - y) * scale];
                if on_canvas.iter().all(|along| (5.0..f64::from(SIDE) - 5.0).contains(along)) {
                    let at = [0, 1].map(|axis| f64::from(place[axis]) + on_canvas[axis]);
                    cross(area, at, if lenslet.kept { KEPT } else { LEFT_OUT })?;
                }
            }
            let frame = [(place[0], place[1]), (place[0] + SIDE, place[1] + SIDE)];
            area.draw(&Rectangle::new(frame, INK)).map_err(words)?;
            let label = format!("{name}, from x {} y {}, {} px", corner[0], corner[1], self.side_px);
            text(area, &label, (place[0], place[1] + SIDE + 6), TEXT_PX)?;
        }
        Ok(())
    }

    /// The pixels, or where there are too many the means of some, as grey from the darkest to the brightest.
    fn cells(&self, area: &Area, [left, top]: [i32; 2], white: &Array2<f32>, [x, y]: [usize; 2]) -> Drawn<()> {
        let cells = self.side_px.min(CELLS);
        let edge = |cell: usize, whole: usize| cell * whole / cells;
        let mean = |row: usize, column: usize| {
            let [rows, columns] = [(row, y), (column, x)]
                .map(|(cell, first)| first + edge(cell, self.side_px)..first + edge(cell + 1, self.side_px));
            white.slice(s![rows, columns]).mean().unwrap_or(0.0)
        };
        let grey = Array2::from_shape_fn((cells, cells), |(row, column)| mean(row, column));
        let (dark, bright) = grey.iter().fold((f32::INFINITY, 0f32), |(low, high), v| (low.min(*v), high.max(*v)));
        let level = |value: f32| (LEVELS * (value - dark) / (bright - dark).max(f32::MIN_POSITIVE)).round();
        for row in 0..cells {
            let mut start = 0;
            for column in 1..=cells {
                let here = level(grey[(row, start)]);
                if column < cells && level(grey[(row, column)]) == here {
                    continue;
                }
                let shade = (255.0 * here / LEVELS) as u8;
                let [from, to] = [start, column].map(|column| left + edge(column, SIDE as usize) as i32);
                let [above, below] = [row, row + 1].map(|row| top + edge(row, SIDE as usize) as i32);
                let cell = Rectangle::new([(from, above), (to, below)], RGBColor(shade, shade, shade).filled());
                area.draw(&cell).map_err(words)?;
                start = column;
            }
        }
        Ok(())
    }
}
