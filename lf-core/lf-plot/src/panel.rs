//! One panel: its size and margins, its axes, title, key and colour bar.

use super::chart::{Mark, Panel};
use super::drawing::{At, Drawing, rounded};
use super::palette::{GRID, INK};
use super::range::{Range, ranges, stretch};
use super::text::{Anchor, LINE, NAME_PX, TEXT_PX, figures, width, wrap};
use super::ticks::{TICK, TICK_TEXT, Tick, ticks, widest};
use super::view::{Looks, PanelView};
use super::{key::Key, map, marks, px_box::PxBox};

/// Distance from the frame to the colour bar, px.
const BAR_GAP: i32 = 14;
/// Distance from the texts of the vertical axis to its name, and from the key to the frame, px.
const NAME_GAP: i32 = 8;

/// A panel and the sizes of its parts.
pub(super) struct PanelLayout<'a> {
    panel: &'a Panel,
    looks: Looks,
    ranges: [Option<Range>; 2],
    size: [i32; 2],
    /// Says that the panel is not to scale, though it should be.
    pub note: Option<String>,
    ticks: [Vec<Tick>; 2],
    title: Vec<String>,
    key: Key,
    names: [Vec<String>; 2],
    bar: Option<map::ColourBar<'a>>,
}

impl<'a> PanelLayout<'a> {
    /// The frame has at most the size `room`, px.
    pub fn new(panel: &'a Panel, looks: Looks, room: [i32; 2]) -> Self {
        let ranges = ranges(panel);
        let (size, note) = size(panel, ranges, room);
        let px_per_unit =
            [0, 1].map(|axis| ranges[axis].map_or(0.0, |range| f64::from(size[axis]) / (range.high() - range.low())));
        Self {
            ticks: [0, 1].map(|axis| ranges[axis].map_or(Vec::new(), |range| ticks(&range, size[axis], axis))),
            title: wrap(&panel.title, NAME_PX, room[0]),
            key: Key::new(panel, &looks, room[0], px_per_unit),
            names: [wrap(&panel.x.name, NAME_PX, room[0]), wrap(&panel.y.name, NAME_PX, size[1].max(120))],
            bar: map::ColourBar::of(panel, size[1]),
            note,
            panel,
            looks,
            ranges,
            size,
        }
    }

    /// Widths of the left margin, the frame and the right margin, px.
    pub fn widths(&self) -> [i32; 3] {
        let left = TICK_TEXT + widest(&self.ticks[1]) + NAME_GAP + LINE * self.names[1].len() as i32;
        let bar = self.bar.as_ref().map_or(0, |bar| BAR_GAP + bar.width());
        let title = self.title.iter().map(|line| width(line, NAME_PX)).fold(self.key.width, i32::max);
        [left, self.size[0], bar.max(24).max(title - self.size[0])]
    }

    /// Heights of the upper margin, the frame and the lower margin, px.
    pub fn heights(&self) -> [i32; 3] {
        let above = LINE * self.title.len() as i32 + self.key.height + NAME_GAP;
        [above, self.size[1], self.ticks_below() + LINE * self.names[0].len() as i32 + 6]
    }

    fn ticks_below(&self) -> i32 {
        if self.ticks[0].is_empty() { 8 } else { 28 }
    }

    /// Draws it with the upper left corner of its frame at a place.
    pub fn draw(&self, drawing: &mut Drawing, [left, top]: [i32; 2]) {
        let low = [left, top].map(f64::from);
        let frame = PxBox { low, high: [0, 1].map(|axis| low[axis] + f64::from(self.size[axis])) };
        let title_top = top - self.heights()[0];
        for (n, line) in self.title.iter().enumerate() {
            drawing.text(line, (left, title_top + LINE / 2 + n as i32 * LINE), NAME_PX, Anchor::Left);
        }
        self.key.draw(drawing, (left, top - self.key.height - NAME_GAP));
        self.contents(drawing, frame);
        drawing.frame([rounded(frame.low), rounded(frame.high)], INK);
        self.ticks(drawing, frame);
        self.names(drawing, [left, top]);
        if let Some(bar) = &self.bar {
            bar.draw(drawing, [left + self.size[0] + BAR_GAP, top]);
        }
    }

    /// Draws the grid and the marks, or says that there is no data.
    fn contents(&self, drawing: &mut Drawing, frame: PxBox) {
        let ([Some(x), Some(y)], true) = (self.ranges, self.has_data()) else {
            let middle = [0, 1].map(|axis| 0.5 * (frame.low[axis] + frame.high[axis]));
            drawing.text("no data", rounded(middle), NAME_PX, Anchor::Middle);
            return;
        };
        let view = PanelView { panel: self.panel, frame, x, y, looks: &self.looks };
        marks::regions(drawing, &view);
        for (axis, at, _) in self.tick_places(frame) {
            let end = |corner: At| if axis == 0 { [at, corner[1]] } else { [corner[0], at] };
            drawing.line([frame.low, frame.high].map(|corner| rounded(end(corner))), GRID, 1);
        }
        marks::marks(drawing, &view);
    }

    fn ticks(&self, drawing: &mut Drawing, frame: PxBox) {
        let (left, bottom, length) = (frame.low[0], frame.high[1], f64::from(TICK));
        for (axis, at, label) in self.tick_places(frame) {
            if axis == 0 {
                drawing.line([[at, bottom], [at, bottom + length]].map(rounded), INK, 1);
                drawing.text(label, rounded([at, bottom + 16.0]), TEXT_PX, Anchor::Middle);
            } else {
                drawing.line([[left - length, at], [left, at]].map(rounded), INK, 1);
                drawing.text(label, rounded([left - f64::from(TICK_TEXT), at]), TEXT_PX, Anchor::Right);
            }
        }
    }

    /// Axis, place along it in px, and text of every tick.
    fn tick_places(&self, frame: PxBox) -> impl Iterator<Item = (usize, f64, &str)> {
        let [[left, top], [right, bottom]] = [frame.low, frame.high];
        let axes = self.ticks.iter().zip(self.ranges).enumerate();
        axes.filter_map(|(axis, (ticks, range))| Some((axis, ticks, range?))).flat_map(move |(axis, ticks, range)| {
            ticks.iter().map(move |(value, label)| {
                let share = range.share(*value).clamp(0.0, 1.0);
                let at = if axis == 0 { left + share * (right - left) } else { bottom - share * (bottom - top) };
                (axis, at, label.as_str())
            })
        })
    }

    fn names(&self, drawing: &mut Drawing, [left, top]: [i32; 2]) {
        let below = self.ticks_below() + 6;
        for (n, line) in self.names[0].iter().enumerate() {
            let y = top + self.size[1] + below + n as i32 * LINE;
            drawing.text(line, (left + self.size[0] / 2, y), NAME_PX, Anchor::Middle);
        }
        for (n, line) in self.names[1].iter().enumerate() {
            let x = left - self.widths()[0] + LINE / 2 + n as i32 * LINE;
            drawing.upright_text(line, (x, top + self.size[1] / 2), NAME_PX);
        }
    }

    /// Whether a mark other than a reference or a region has something to show.
    fn has_data(&self) -> bool {
        let holds = |[x, y]: &[f64; 2]| self.panel.x.holds(*x) && self.panel.y.holds(*y);
        self.panel.marks.iter().any(|mark| match mark {
            Mark::Line { points, .. } => points.iter().any(holds),
            Mark::Arrows(arrows) => arrows.points.iter().any(holds),
            Mark::Steps { values, .. } => values.iter().any(|value| value.is_finite()),
            Mark::Map { .. } => map::scale(mark).is_some(),
            Mark::Reference { .. } | Mark::Region { .. } => false,
        })
    }
}

/// The size of the frame, px, and a note if it is stretched.
fn size(panel: &Panel, ranges: [Option<Range>; 2], room: [i32; 2]) -> ([i32; 2], Option<String>) {
    let ([Some(x), Some(y)], true) = (ranges, panel.is_to_scale && !panel.x.is_log && !panel.y.is_log) else {
        return (room, None);
    };
    let spans = [x, y].map(|range| range.high() - range.low());
    let stretch = stretch(spans);
    let note = [&panel.x, &panel.y].into_iter().zip(stretch).find(|(_, factor)| *factor > 1.0).map(|(axis, factor)| {
        let name = axis.name.split(',').next().unwrap_or_default();
        format!("{name} stretched {} times", figures(factor))
    });
    let spans = [spans[0] * stretch[0], spans[1] * stretch[1]];
    let px = (f64::from(room[0]) / spans[0]).min(f64::from(room[1]) / spans[1]);
    (spans.map(|span| (span * px).round() as i32), note)
}
