//! One panel: its room, and what stands about its marks.

use super::chart::{Axis, Mark, Panel};
use super::clip::Frame;
use super::extent::ranges;
use super::key::Key;
use super::palette::{GRID, INK, scale};
use super::scale::{Range, Tick, Way, ticks};
use super::text::{From, NAME_PX, TEXT_PX, text, upright, width, wrap};
use super::view::{Looks, View, rounded};
use super::{Area, Drawn, map, marks, words};
use plotters::prelude::*;

/// Height of a line of a title or of a name, px.
const LINE: i32 = 22;
/// Length of a tick, and where its text starts.
const TICK: i32 = 5;
const TEXT_FROM: i32 = 9;
/// Distance from the frame to the bar of colours, and its width.
const BAR_FROM: i32 = 14;
const BAR: i32 = 15;

/// Room about a frame, px: left, top, right, below.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Margins {
    pub left: i32,
    pub top: i32,
    pub right: i32,
    pub below: i32,
}

/// A panel that knows its room.
pub(super) struct Prepared<'a> {
    panel: &'a Panel,
    looks: Looks,
    ranges: [Option<Range>; 2],
    size: [i32; 2],
    ticks: [Vec<Tick>; 2],
    title: Vec<String>,
    key: Key,
    names: [Vec<String>; 2],
    bar: Option<Bar<'a>>,
}

/// A bar of colours.
struct Bar<'a> {
    scale: &'a Axis,
    range: Range,
    ticks: Vec<Tick>,
}

impl<'a> Prepared<'a> {
    /// A panel whose frame is at most of `room`.
    pub fn new(panel: &'a Panel, looks: Looks, room: [i32; 2]) -> Self {
        let ranges = ranges(panel);
        let mut size = room;
        if let ([Some(x), Some(y)], true) = (ranges, panel.is_to_scale && !panel.x.is_log && !panel.y.is_log) {
            let spans = [x, y].map(|range| (range.last - range.first).abs());
            let px = (f64::from(room[0]) / spans[0]).min(f64::from(room[1]) / spans[1]);
            size = spans.map(|span| ((span * px).round() as i32).max(40));
        }
        let on = |axis: usize, way: Way| ranges[axis].map_or(Vec::new(), |range| ticks(&range, size[axis], way));
        let bar = panel.marks.iter().find_map(|mark| {
            let Mark::Map { scale, .. } = mark else { return None };
            let range = map::range(mark)?;
            Some(Bar { scale, range, ticks: ticks(&range, size[1], Way::Up) })
        });
        Self {
            ticks: [on(0, Way::Across), on(1, Way::Up)],
            title: wrap(&panel.title, NAME_PX, room[0]),
            key: Key::new(panel, &looks, room[0]),
            names: [wrap(&panel.x.name, NAME_PX, room[0]), wrap(&panel.y.name, NAME_PX, size[1].max(120))],
            bar,
            panel,
            looks,
            ranges,
            size,
        }
    }

    /// Room that it needs about its frame.
    pub fn margins(&self) -> Margins {
        let below = if self.ticks[0].is_empty() { 8 } else { 28 };
        Margins {
            left: TEXT_FROM + widest(&self.ticks[1]) + 8 + LINE * self.names[1].len() as i32,
            top: LINE * self.title.len() as i32 + self.key.height + 8,
            right: self.bar.as_ref().map_or(0, |bar| bar.width(self.size[1])).max(24),
            below: below + LINE * self.names[0].len() as i32 + 6,
        }
    }

    /// Draws it, the corner of its frame at a place; counts labels without room.
    pub fn draw(&self, area: &Area, [left, top]: [i32; 2]) -> Drawn<usize> {
        let corner = [left, top].map(f64::from);
        let end = [0, 1].map(|axis| corner[axis] + f64::from(self.size[axis]));
        let frame = Frame { low: corner, high: end };
        let margin = self.margins();
        for (n, line) in self.title.iter().enumerate() {
            let y = top - margin.top + LINE / 2 + n as i32 * LINE;
            text(area, line, (left, y), NAME_PX, From::Left)?;
        }
        self.key.draw(area, (left, top - self.key.height - 8))?;
        let mut left_out = 0;
        let outline = Rectangle::new([rounded(corner), rounded(end)], INK);
        match (self.ranges, self.has_data()) {
            ([Some(x), Some(y)], true) => {
                let view = View { panel: self.panel, frame, x, y, looks: &self.looks };
                marks::regions(area, &view)?;
                self.ticks(area, frame, true)?;
                left_out = marks::marks(area, &view)?;
            }
            _ => {
                let middle = [0, 1].map(|axis| 0.5 * (corner[axis] + end[axis]));
                text(area, "no data", rounded(middle), NAME_PX, From::Middle)?;
            }
        }
        area.draw(&outline).map_err(words)?;
        self.ticks(area, frame, false)?;
        let below = margin.below - LINE * self.names[0].len() as i32;
        for (n, line) in self.names[0].iter().enumerate() {
            let place = (left + self.size[0] / 2, top + self.size[1] + below + n as i32 * LINE);
            text(area, line, place, NAME_PX, From::Middle)?;
        }
        for (n, line) in self.names[1].iter().enumerate() {
            let x = left - margin.left + LINE / 2 + n as i32 * LINE;
            upright(area, line, (x, top + self.size[1] / 2), NAME_PX)?;
        }
        if let Some(bar) = &self.bar {
            bar.draw(area, [left + self.size[0] + BAR_FROM, top], self.size[1])?;
        }
        Ok(left_out)
    }

    /// Lines through the frame, or ticks outside it and their texts.
    fn ticks(&self, area: &Area, frame: Frame, is_grid: bool) -> Drawn<()> {
        let [[left, top], [right, bottom]] = [frame.low, frame.high];
        for (axis, ticks) in self.ticks.iter().enumerate() {
            let Some(range) = self.ranges[axis] else { continue };
            for (value, label) in ticks {
                let share = range.share(*value).clamp(0.0, 1.0);
                let at = if axis == 0 { left + share * (right - left) } else { bottom - share * (bottom - top) };
                let outside = f64::from(TICK);
                let ends = match (axis, is_grid) {
                    (0, true) => [[at, top], [at, bottom]],
                    (0, false) => [[at, bottom], [at, bottom + outside]],
                    (_, true) => [[left, at], [right, at]],
                    (_, false) => [[left - outside, at], [left, at]],
                };
                let colour = if is_grid { GRID } else { INK };
                area.draw(&PathElement::new(ends.map(rounded).to_vec(), colour)).map_err(words)?;
                if !is_grid {
                    let (place, from) = if axis == 0 {
                        ([at, bottom + 16.0], From::Middle)
                    } else {
                        ([left - f64::from(TEXT_FROM), at], From::Right)
                    };
                    text(area, label, rounded(place), TEXT_PX, from)?;
                }
            }
        }
        Ok(())
    }

    /// Whether a mark other than a reference or a region has something to show.
    fn has_data(&self) -> bool {
        let holds = |[x, y]: &[f64; 2]| self.panel.x.holds(*x) && self.panel.y.holds(*y);
        self.panel.marks.iter().any(|mark| match mark {
            Mark::Line { points, .. } | Mark::Points { points, .. } => points.iter().any(holds),
            Mark::Arrows { points, .. } => points.iter().any(holds),
            Mark::Steps { values, .. } => values.iter().any(|value| value.is_finite()),
            Mark::Map { .. } => map::range(mark).is_some(),
            Mark::Reference { .. } | Mark::Region { .. } => false,
        })
    }
}

impl Bar<'_> {
    fn name(&self, height: i32) -> Vec<String> {
        wrap(&self.scale.name, NAME_PX, height.max(120))
    }

    fn width(&self, height: i32) -> i32 {
        BAR_FROM + BAR + TEXT_FROM + widest(&self.ticks) + 8 + LINE * self.name(height).len() as i32 + 4
    }

    fn draw(&self, area: &Area, [left, top]: [i32; 2], height: i32) -> Drawn<()> {
        let right = left + BAR;
        let colours = scale(&self.range);
        for y in 0..height {
            let colour = colours(1.0 - (f64::from(y) + 0.5) / f64::from(height));
            area.draw(&Rectangle::new([(left, top + y), (right, top + y + 1)], colour.filled())).map_err(words)?;
        }
        area.draw(&Rectangle::new([(left, top), (right, top + height)], INK)).map_err(words)?;
        for (value, label) in &self.ticks {
            let y = top + ((1.0 - self.range.share(*value).clamp(0.0, 1.0)) * f64::from(height)).round() as i32;
            area.draw(&PathElement::new(vec![(right, y), (right + TICK, y)], INK)).map_err(words)?;
            text(area, label, (right + TEXT_FROM, y), TEXT_PX, From::Left)?;
        }
        for (n, line) in self.name(height).iter().enumerate() {
            let x = right + TEXT_FROM + widest(&self.ticks) + 8 + LINE / 2 + n as i32 * LINE;
            upright(area, line, (x, top + height / 2), NAME_PX)?;
        }
        Ok(())
    }
}

/// Width of the widest text of ticks.
fn widest(ticks: &[Tick]) -> i32 {
    ticks.iter().map(|(_, label)| width(label, TEXT_PX)).max().unwrap_or(0)
}
