//! A panel with its place on the canvas.

use super::chart::{Mark, Panel, Place};
use super::{canvas::At, clip::Frame, looks::Looks, range::Range};

/// Maps the values of a panel to pixels.
pub(super) struct View<'a> {
    pub panel: &'a Panel,
    pub frame: Frame,
    pub x: Range,
    pub y: Range,
    pub looks: &'a Looks,
}

impl View<'_> {
    /// The place of a point. NaN if an axis has no place for it.
    pub fn at(&self, [x, y]: [f64; 2]) -> At {
        let [x, y] = [self.x.share(x), self.y.share(y)];
        let Frame { low, high } = self.frame;
        [low[0] + x * (high[0] - low[0]), high[1] - y * (high[1] - low[1])]
    }

    /// The place of a point. On a logarithmic axis, y at or below zero is the end of the axis.
    pub fn at_or_below(&self, [x, y]: [f64; 2]) -> At {
        if y <= 0.0 && self.y.is_log {
            let end = if self.y.first < self.y.last { self.frame.high[1] } else { self.frame.low[1] };
            return [self.at([x, self.y.first])[0], end];
        }
        self.at([x, y])
    }

    /// The places of points.
    pub fn places(&self, points: &[[f64; 2]]) -> Vec<At> {
        points.iter().map(|point| self.at(*point)).collect()
    }

    /// Pixels to the right and upwards for one unit along x and along y; both axes are linear.
    pub fn px_per_unit(&self) -> [f64; 2] {
        let Frame { low, high } = self.frame;
        [(high[0] - low[0]) / (self.x.last - self.x.first), (high[1] - low[1]) / (self.y.last - self.y.first)]
    }

    /// The places that a reference runs through.
    pub fn reference(&self, place: &Place) -> Vec<At> {
        let (low, high) = (self.frame.low, self.frame.high);
        match place {
            Place::Vertical(x) => [low[1], high[1]].map(|y| [self.at([*x, self.y.first])[0], y]).to_vec(),
            Place::Horizontal(y) => [low[0], high[0]].map(|x| [x, self.at([self.x.first, *y])[1]]).to_vec(),
            Place::Curve(points) => self.places(points),
        }
    }
}

/// The number of a reference's name among the names of the panel's references.
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
