//! The bar of colours beside a map.

use super::chart::{Axis, Panel};
use super::palette::{INK, map_colours};
use super::text::{Anchor, LINE, NAME_PX, TEXT_PX, wrap};
use super::ticks::{Direction, TICK, TICK_TEXT, Tick, ticks, widest};
use super::{canvas::Canvas, map, range::Range};

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
            let (scale, range) = map::scale(mark)?;
            Some(Self { scale, range, ticks: ticks(&range, height, Direction::Vertical), height })
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
    pub fn draw(&self, canvas: &mut Canvas, [left, top]: [i32; 2]) {
        let (right, height) = (left + BAR, self.height);
        let colours = map_colours(&self.range);
        for y in 0..height {
            let colour = colours(1.0 - (f64::from(y) + 0.5) / f64::from(height));
            canvas.block([(left, top + y), (right, top + y + 1)], colour);
        }
        canvas.frame([(left, top), (right, top + height)], INK);
        for (value, label) in &self.ticks {
            let y = top + ((1.0 - self.range.share(*value).clamp(0.0, 1.0)) * f64::from(height)).round() as i32;
            canvas.line([(right, y), (right + TICK, y)], INK, 1);
            canvas.text(label, (right + TICK_TEXT, y), TEXT_PX, Anchor::Left);
        }
        for (n, line) in self.name().iter().enumerate() {
            let x = right + TICK_TEXT + widest(&self.ticks) + NAME_GAP + LINE / 2 + n as i32 * LINE;
            canvas.upright_text(line, (x, top + height / 2), NAME_PX);
        }
    }
}
