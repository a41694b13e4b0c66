//! A panel with its place on the canvas.

use super::chart::{Mark, Panel};
use super::clip::{At, Frame};
use super::palette::Look;
use super::scale::Range;

/// Values of a panel to pixels.
pub(super) struct View<'a> {
    pub panel: &'a Panel,
    pub frame: Frame,
    pub x: Range,
    pub y: Range,
    pub looks: &'a Looks,
}

impl View<'_> {
    /// The place of a point; NaN where an axis has none for it.
    pub fn at(&self, [x, y]: [f64; 2]) -> At {
        let [x, y] = [self.x.share(x), self.y.share(y)];
        let Frame { low, high } = self.frame;
        [low[0] + x * (high[0] - low[0]), high[1] - y * (high[1] - low[1])]
    }

    /// The place of a point that goes down to an axis end where y is zero or less and the axis logarithmic.
    pub fn at_or_below(&self, [x, y]: [f64; 2]) -> At {
        if y <= 0.0 && self.y.is_log {
            let end = if self.y.first < self.y.last { self.frame.high[1] } else { self.frame.low[1] };
            return [self.at([x, self.y.first])[0], end];
        }
        self.at([x, y])
    }
}

/// Which of a panel's references, counted by their names, has a name.
pub(super) fn reference_number(panel: &Panel, name: &str) -> usize {
    let mut names: Vec<&str> = Vec::new();
    for mark in &panel.marks {
        if let Mark::Reference { name, .. } = mark
            && !names.contains(&name.as_str())
        {
            names.push(name);
        }
    }
    names.iter().position(|known| *known == name).unwrap_or(0)
}

/// The n-th name of a list has the n-th look.
pub(super) struct Looks(pub Vec<String>);

impl Looks {
    /// The names of the series of some panels.
    pub fn of<'a>(panels: impl IntoIterator<Item = &'a Panel>) -> Self {
        let mut names: Vec<String> = Vec::new();
        let series = panels.into_iter().flat_map(|panel| panel.marks.iter().filter(|mark| mark.is_series()));
        for name in series.map(|mark| mark.name()) {
            if !names.iter().any(|known| known == name) {
                names.push(name.to_owned());
            }
        }
        Self(names)
    }

    pub fn look(&self, name: &str) -> Look {
        Look(self.0.iter().position(|known| known == name).unwrap_or(0))
    }
}

pub(super) fn rounded([x, y]: At) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}
