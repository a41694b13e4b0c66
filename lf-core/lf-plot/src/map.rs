//! Values over the plane as colours, and the bar that explains them.

use super::chart::{Axis, Mark, Panel};
use super::drawing::{Drawing, rounded};
use super::palette::{EMPTY, INK, map_colours};
use super::range::{Range, range_of};
use super::text::{Anchor, LINE, NAME_PX, TEXT_PX, wrap};
use super::ticks::{TICK, TICK_TEXT, Tick, ticks, widest};
use super::view::PanelView;

/// Largest number of cells along an axis.
const MOST_CELLS: usize = 300;
/// Largest number of rectangles. It keeps a picture below a megabyte.
const MOST_RECTANGLES: usize = 8000;
/// Steps of the colours.
const LEVELS: f64 = 48.0;

/// Means over blocks of values.
struct Blocks {
    values: Vec<f64>,
    cells: [usize; 2],
}

/// The scale of a map, and its range: that of the blocks drawn. None if the mark is no map or has no value.
pub(super) fn scale(mark: &Mark) -> Option<(&Axis, Range)> {
    let Mark::Map { scale, .. } = mark else { return None };
    Some((scale, blocks(mark)?.1))
}

/// Whether a map has a cell whose value its scale cannot show.
pub(super) fn has_empty(mark: &Mark) -> bool {
    matches!(mark, Mark::Map { values, scale, .. } if values.iter().any(|value| !scale.holds(*value)))
}

/// The note on a map that is drawn coarser than it is.
pub(super) fn note(mark: &Mark) -> Option<String> {
    let Mark::Map { cells, .. } = mark else { return None };
    let drawn = blocks(mark)?.0.cells;
    let [nx, ny] = [0, 1].map(|axis| cells[axis].div_ceil(drawn[axis]));
    (drawn != *cells).then(|| format!("a coloured cell is the mean of up to {nx} x {ny} values"))
}

/// Draws the cells inside the frame.
pub(super) fn cells(drawing: &mut Drawing, view: &PanelView, mark: &Mark) {
    let Mark::Map { x, y, .. } = mark else { return };
    let Some((blocks, range)) = blocks(mark) else { return };
    let edge = |axis: usize, n: usize| {
        let [first, last] = [x, y][axis];
        first + (last - first) * n as f64 / blocks.cells[axis] as f64
    };
    let colours = map_colours(&range);
    for (row, columns, level) in runs(&blocks, range) {
        let corners = [[columns[0], row], [columns[1], row + 1]].map(|[i, j]| view.at([edge(0, i), edge(1, j)]));
        let corner = |pick: fn(f64, f64) -> f64| {
            let picked = |axis: usize| pick(corners[0][axis], corners[1][axis]);
            rounded([0, 1].map(|axis| picked(axis).clamp(view.frame.low[axis], view.frame.high[axis])))
        };
        let [from, to] = [corner(f64::min), corner(f64::max)];
        if from.0 < to.0 && from.1 < to.1 {
            drawing.block([from, to], level.map_or(EMPTY, |level| colours(f64::from(level) / LEVELS)));
        }
    }
}

/// The finest blocks whose picture is small enough, and their range. None if the map has no value.
fn blocks(mark: &Mark) -> Option<(Blocks, Range)> {
    let Mark::Map { values, cells, scale, .. } = mark else { return None };
    if values.is_empty() {
        return None;
    }
    let mut most = MOST_CELLS;
    loop {
        let blocks = means(values, *cells, cells.map(|count| count.min(most)));
        let range = range_of(blocks.values.iter().copied(), scale, [0.0; 2])?;
        if most <= 8 || runs(&blocks, range).count() <= MOST_RECTANGLES {
            return Some((blocks, range));
        }
        most = most * 5 / 6;
    }
}

/// Means of the finite values of each block; NaN for a block without any.
fn means(values: &[f64], from: [usize; 2], to: [usize; 2]) -> Blocks {
    let edge = |axis: usize, n: usize| n * from[axis] / to[axis];
    let mean = |i: usize, j: usize| {
        let rows = edge(1, j)..edge(1, j + 1);
        let block = rows.flat_map(|row| &values[row * from[0] + edge(0, i)..row * from[0] + edge(0, i + 1)]);
        let (sum, count) = block.filter(|value| value.is_finite()).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
        sum / count
    };
    Blocks { values: (0..to[0] * to[1]).map(|n| mean(n % to[0], n / to[0])).collect(), cells: to }
}

/// Neighbouring cells of a row that have one colour: row, first and last column + 1, and level; an empty cell has none.
fn runs(blocks: &Blocks, range: Range) -> impl Iterator<Item = (usize, [usize; 2], Option<u8>)> {
    let level = move |value: &f64| {
        let share = range.share(*value);
        share.is_finite().then(|| (share.clamp(0.0, 1.0) * LEVELS).round() as u8)
    };
    blocks.values.chunks(blocks.cells[0]).enumerate().flat_map(move |(row, values)| {
        let mut start = 0;
        let runs = values.chunk_by(move |one, other| level(one) == level(other));
        runs.map(move |run| {
            let columns = [start, start + run.len()];
            start = columns[1];
            (row, columns, level(&run[0]))
        })
    })
}

/// Width of the bar, px.
const BAR: i32 = 15;
/// Distance between the ticks' texts and the name, px.
const NAME_GAP: i32 = 8;

/// The bar of a map's colours, as high as the panel.
pub(super) struct ColourBar<'a> {
    scale: &'a Axis,
    range: Range,
    ticks: Vec<Tick>,
    height: i32,
}

impl<'a> ColourBar<'a> {
    /// The bar of the first map of a panel that has values.
    pub fn of(panel: &'a Panel, height: i32) -> Option<Self> {
        panel.marks.iter().find_map(|mark| {
            let (axis, range) = scale(mark)?;
            Some(Self { scale: axis, range, ticks: ticks(&range, height, 1), height })
        })
    }

    fn name(&self) -> Vec<String> {
        wrap(&self.scale.name, NAME_PX, self.height.max(120))
    }

    /// Its width with ticks and name, px.
    pub fn width(&self) -> i32 {
        BAR + TICK_TEXT + widest(&self.ticks) + NAME_GAP + LINE * self.name().len() as i32 + 4
    }

    /// Draws it with its top left corner at a place.
    pub fn draw(&self, drawing: &mut Drawing, [left, top]: [i32; 2]) {
        let (right, height) = (left + BAR, self.height);
        let colours = map_colours(&self.range);
        for y in 0..height {
            let colour = colours(1.0 - (f64::from(y) + 0.5) / f64::from(height));
            drawing.block([(left, top + y), (right, top + y + 1)], colour);
        }
        drawing.frame([(left, top), (right, top + height)], INK);
        for (value, label) in &self.ticks {
            let y = top + ((1.0 - self.range.share(*value).clamp(0.0, 1.0)) * f64::from(height)).round() as i32;
            drawing.line([(right, y), (right + TICK, y)], INK, 1);
            drawing.text(label, (right + TICK_TEXT, y), TEXT_PX, Anchor::Left);
        }
        for (n, line) in self.name().iter().enumerate() {
            let x = right + TICK_TEXT + widest(&self.ticks) + NAME_GAP + LINE / 2 + n as i32 * LINE;
            drawing.upright_text(line, (x, top + height / 2), NAME_PX);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(values: Vec<f64>, cells: [usize; 2]) -> Mark {
        Mark::Map { values, cells, x: [0.0, 1.0], y: [0.0, 1.0], scale: Axis::new("v") }
    }

    #[test]
    fn small_maps_are_drawn_as_they_are() {
        let mark = map(vec![1.0, 2.0, f64::NAN, 2.0, 2.0, 2.0], [3, 2]);
        let (blocks, range) = blocks(&mark).unwrap();
        let found: Vec<_> = runs(&blocks, range).collect();
        let top = Some(LEVELS as u8);
        assert_eq!(found, [(0, [0, 1], Some(0)), (0, [1, 2], top), (0, [2, 3], None), (1, [0, 3], top)]);
        assert!(note(&mark).is_none() && has_empty(&mark));
    }

    #[test]
    fn fine_maps_become_means_and_a_note_says_so() {
        let mark = map((0..1200 * 600u64).map(|n| ((n * 7919) % 1000) as f64).collect(), [1200, 600]);
        let (blocks, _) = blocks(&mark).unwrap();
        assert!(blocks.cells[0] * blocks.cells[1] <= 2 * MOST_RECTANGLES);
        let mean = blocks.values.iter().sum::<f64>() / blocks.values.len() as f64;
        assert!((mean - 499.5).abs() < 5.0, "{mean}");
        assert!(note(&mark).unwrap().starts_with("a coloured cell is the mean of up to"));
    }
}
