//! The colour and the marker of each series.

use super::canvas::{Canvas, Pixel};
use super::chart::Panel;
use super::palette::{COLOURS, Colour};

/// The look of a chart's n-th series: a colour, and a marker. When the colours begin again, the markers are shifted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Look(pub usize);

impl Look {
    pub fn colour(self) -> Colour {
        COLOURS[self.0 % COLOURS.len()]
    }

    /// Draws the marker about a place.
    pub fn marker(self, canvas: &mut Canvas, (x, y): Pixel) {
        let colour = self.colour();
        let shifted = |(right, down): Pixel| (x + right, y + down);
        match (self.0 + self.0 / COLOURS.len()) % 7 {
            0 => canvas.disc((x, y), 4, colour),
            1 => canvas.polygon([(-4, -4), (4, -4), (4, 4), (-4, 4)].map(shifted), colour, 1.0),
            2 => canvas.polygon([(0, -5), (5, 4), (-5, 4)].map(shifted), colour, 1.0),
            3 => canvas.polygon([(0, -6), (5, 0), (0, 6), (-5, 0)].map(shifted), colour, 1.0),
            4 => canvas.polygon([(0, 5), (5, -4), (-5, -4)].map(shifted), colour, 1.0),
            5 => {
                canvas.line([(-4, -4), (4, 4)].map(shifted), colour, 2);
                canvas.line([(-4, 4), (4, -4)].map(shifted), colour, 2);
            }
            _ => canvas.plus((x, y), colour),
        }
    }
}

/// The names of the series in order: the n-th name has the n-th [`Look`].
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

/// Whether a panel has two series or more, which its markers have to tell apart.
pub(super) fn has_many_series(panel: &Panel) -> bool {
    Looks::of([panel]).0.len() > 1
}
