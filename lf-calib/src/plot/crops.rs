//! Magnified pieces of the white image: the four corners and the middle.

use crate::Calibrated;
use lf_plot::{Anchor, COLOURS, Colour, Drawing, INK, TEXT_PX, grey, rounded};
use ndarray::{Array2, s};

/// Colours of the centres of lenslets that were kept, and of those that were left out.
pub(super) const KEPT: Colour = COLOURS[2];
pub(super) const LEFT_OUT: Colour = COLOURS[1];
/// Side of a piece and distance between two, px.
const SIDE: i32 = 224;
const GAP: i32 = 10;
/// Largest number of cells along a piece: it limits the size of the file.
const CELLS: usize = 56;
/// Side of a piece in pitches.
const PITCHES: f64 = 4.0;
/// Number of grey levels: neighbouring cells of the same level are drawn as one.
const LEVELS: f32 = 40.0;
/// Smallest distance of a centre from the edge of its piece, px.
const CROSS: f64 = 5.0;

pub(super) struct Crops {
    /// Name and first pixel (column, row) of each piece.
    corners: Vec<(&'static str, [usize; 2])>,
    /// Side of a piece, pixels of the image.
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
        count * SIDE + (count - 1) * GAP
    }

    pub fn height(&self) -> i32 {
        SIDE + TEXT_PX + 8
    }

    /// Draws the pieces in a row, with the camera's centres over them.
    pub fn draw(&self, drawing: &mut Drawing, [left, top]: [i32; 2], white: &Array2<f32>, calibrated: &Calibrated) {
        for (n, (name, corner)) in self.corners.iter().enumerate() {
            let place = [left + n as i32 * (SIDE + GAP), top];
            self.cells(drawing, place, white, *corner);
            self.centres(drawing, place, *corner, calibrated);
            drawing.frame([(place[0], place[1]), (place[0] + SIDE, place[1] + SIDE)], INK);
            let label = format!("{name}, from ({}, {}), {} px", corner[0], corner[1], self.side_px);
            drawing.text(&label, (place[0], place[1] + SIDE + 13), TEXT_PX, Anchor::Left);
        }
    }

    fn centres(&self, drawing: &mut Drawing, place: [i32; 2], corner: [usize; 2], calibrated: &Calibrated) {
        let scale = f64::from(SIDE) / self.side_px as f64;
        for lenslet in &calibrated.residuals {
            let on_piece =
                [0, 1].map(|axis| (lenslet.place_px[axis] - lenslet.residual_px[axis] - corner[axis] as f64) * scale);
            if on_piece.iter().all(|along| (CROSS..f64::from(SIDE) - CROSS).contains(along)) {
                let at = [0, 1].map(|axis| f64::from(place[axis]) + on_piece[axis]);
                drawing.plus(rounded(at), if lenslet.kept { KEPT } else { LEFT_OUT });
            }
        }
    }

    /// The pixels in grey from the darkest to the brightest; means of blocks beyond [`CELLS`] along a side.
    fn cells(&self, drawing: &mut Drawing, [left, top]: [i32; 2], white: &Array2<f32>, [x, y]: [usize; 2]) {
        let cells = self.side_px.min(CELLS);
        let edge = |cell: usize, whole: usize| cell * whole / cells;
        let mean = |row: usize, column: usize| {
            let [rows, columns] = [(row, y), (column, x)]
                .map(|(cell, first)| first + edge(cell, self.side_px)..first + edge(cell + 1, self.side_px));
            white.slice(s![rows, columns]).mean().unwrap_or(0.0)
        };
        let means = Array2::from_shape_fn((cells, cells), |(row, column)| mean(row, column));
        let (dark, bright) = means.iter().fold((f32::INFINITY, 0f32), |(low, high), v| (low.min(*v), high.max(*v)));
        let level = |value: f32| (LEVELS * (value - dark) / (bright - dark).max(f32::MIN_POSITIVE)).round();
        for (row, values) in means.rows().into_iter().enumerate() {
            let levels: Vec<f32> = values.iter().map(|value| level(*value)).collect();
            let [above, below] = [row, row + 1].map(|row| top + edge(row, SIDE as usize) as i32);
            let mut start = 0;
            for run in levels.chunk_by(f32::eq) {
                let end = start + run.len();
                let [from, to] = [start, end].map(|column| left + edge(column, SIDE as usize) as i32);
                drawing.block([(from, above), (to, below)], grey(f64::from(run[0] / LEVELS)));
                start = end;
            }
        }
    }
}
