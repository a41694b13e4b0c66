//! A panel with its place on the drawing, and the looks of its series.

use super::chart::{Mark, Panel, Place};
use super::drawing::{At, Drawing, Pixel};
use super::palette::{COLOURS, Colour};
use super::{px_box::PxBox, range::Range};

/// The look of a chart's n-th series: a colour, and a marker. When the colours begin again, the markers are shifted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Look(pub usize);

impl Look {
    pub fn colour(self) -> Colour {
        COLOURS[self.0 % COLOURS.len()]
    }

    /// Draws the marker about a place.
    pub fn marker(self, drawing: &mut Drawing, (x, y): Pixel) {
        let colour = self.colour();
        let shifted = |(right, down): Pixel| (x + right, y + down);
        match (self.0 + self.0 / COLOURS.len()) % 7 {
            0 => drawing.disc((x, y), 4, colour),
            1 => drawing.polygon([(-4, -4), (4, -4), (4, 4), (-4, 4)].map(shifted), colour),
            2 => drawing.polygon([(0, -5), (5, 4), (-5, 4)].map(shifted), colour),
            3 => drawing.polygon([(0, -6), (5, 0), (0, 6), (-5, 0)].map(shifted), colour),
            4 => drawing.polygon([(0, 5), (5, -4), (-5, -4)].map(shifted), colour),
            5 => {
                drawing.line([(-4, -4), (4, 4)].map(shifted), colour, 2);
                drawing.line([(-4, 4), (4, -4)].map(shifted), colour, 2);
            }
            _ => drawing.plus((x, y), colour),
        }
    }
}

/// The names of the series. The n-th name has the n-th [`Look`].
pub(super) struct Looks(pub Vec<String>);

impl Looks {
    /// The names of the series of some panels.
    pub fn of<'a>(panels: impl IntoIterator<Item = &'a Panel>) -> Self {
        let series = panels.into_iter().flat_map(|panel| panel.marks.iter().filter(|mark| mark.is_series()));
        Self(distinct(series.map(|mark| mark.name().to_owned())))
    }

    pub fn look(&self, name: &str) -> Look {
        Look(self.0.iter().position(|known| known == name).unwrap_or(0))
    }
}

/// Values without repetitions, in their order.
pub(super) fn distinct<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    let add = |mut known: Vec<T>, one: T| {
        if !known.contains(&one) {
            known.push(one);
        }
        known
    };
    all.fold(Vec::new(), add)
}

/// Whether a panel has two series or more, so that markers must distinguish them.
pub(super) fn has_many_series(panel: &Panel) -> bool {
    Looks::of([panel]).0.len() > 1
}

/// Maps the values of a panel to pixels.
pub(super) struct PanelView<'a> {
    pub panel: &'a Panel,
    pub frame: PxBox,
    pub x: Range,
    pub y: Range,
    pub looks: &'a Looks,
}

impl PanelView<'_> {
    /// The place of a point. NaN if an axis has no place for it.
    pub fn at(&self, [x, y]: [f64; 2]) -> At {
        let [x, y] = [self.x.share(x), self.y.share(y)];
        let PxBox { low, high } = self.frame;
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

    pub fn places(&self, points: &[[f64; 2]]) -> Vec<At> {
        points.iter().map(|point| self.at(*point)).collect()
    }

    /// Pixels to the right and upwards for one unit along x and along y; both axes are linear.
    pub fn px_per_unit(&self) -> [f64; 2] {
        let PxBox { low, high } = self.frame;
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
    let references = panel.marks.iter().filter(|mark| matches!(mark, Mark::Reference { .. }));
    distinct(references.map(Mark::name)).iter().position(|known| *known == name).unwrap_or(0)
}
