//! Colours and markers that are told apart with any eyes, and in grey.

use super::scale::Range;
use super::{Area, Drawn, words};
use plotters::prelude::*;

/// Words, frames.
pub(super) const INK: RGBColor = RGBColor(25, 25, 35);
/// References.
pub(super) const GREY: RGBColor = RGBColor(115, 115, 120);
/// Lines at the ticks.
pub(super) const GRID: RGBColor = RGBColor(232, 232, 236);
/// Cells of a map without a value.
pub(super) const EMPTY: RGBColor = RGBColor(205, 205, 205);
/// Regions in turn.
pub(super) const SHADES: [RGBColor; 3] = [RGBColor(250, 240, 205), RGBColor(222, 236, 247), RGBColor(236, 228, 240)];
/// Dashes of references in turn: stroke, gap, stroke, gap, px.
pub(super) const DASHES: [[f64; 4]; 4] =
    [[8.0, 5.0, 8.0, 5.0], [2.0, 4.0, 2.0, 4.0], [9.0, 4.0, 2.0, 4.0], [16.0, 6.0, 16.0, 6.0]];
/// Dashes of a dashed series.
pub(super) const SERIES_DASH: [f64; 4] = [7.0, 4.0, 7.0, 4.0];

/// Constant: the colours of Okabe and Ito (2008) without yellow, which is faint on white.
pub(super) const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(25, 25, 35),
];

/// Constant: nine colours of viridis (van der Walt and Smith 2015), evenly apart; between them it is linear.
const SEQUENCE: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 45.0, 123.0],
    [59.0, 82.0, 139.0],
    [44.0, 114.0, 142.0],
    [33.0, 145.0, 140.0],
    [40.0, 174.0, 128.0],
    [94.0, 201.0, 98.0],
    [173.0, 220.0, 48.0],
    [253.0, 231.0, 37.0],
];

/// Constant: blue, white and red that end light enough for ink, for values about 0.
const SIGNED: [[f64; 3]; 7] = [
    [62.0, 118.0, 186.0],
    [126.0, 168.0, 214.0],
    [192.0, 213.0, 234.0],
    [248.0, 247.0, 244.0],
    [247.0, 208.0, 188.0],
    [230.0, 150.0, 124.0],
    [202.0, 86.0, 70.0],
];

/// The colours of a map whose scale has this range: signed where it is symmetric about 0, by share from 0 to 1.
pub(super) fn scale(range: &Range) -> fn(f64) -> RGBColor {
    if range.first == -range.last { |share| between(&SIGNED, share) } else { |share| between(&SEQUENCE, share) }
}

fn between(colours: &[[f64; 3]], share: f64) -> RGBColor {
    let place = share.clamp(0.0, 1.0) * (colours.len() - 1) as f64;
    let below = (place as usize).min(colours.len() - 2);
    let [r, g, b] = [0, 1, 2].map(|channel| {
        let [low, high] = [colours[below][channel], colours[below + 1][channel]];
        (low + (high - low) * (place - below as f64)).round() as u8
    });
    RGBColor(r, g, b)
}

/// The look of a chart's n-th series: a colour, and a marker that shifts when the colours begin again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Look(pub usize);

impl Look {
    pub fn colour(self) -> RGBColor {
        COLOURS[self.0 % COLOURS.len()]
    }

    /// The marker about a place.
    pub fn marker(self, area: &Area, (x, y): (i32, i32)) -> Drawn<()> {
        let colour = self.colour();
        let shape = (self.0 + self.0 / COLOURS.len()) % 7;
        let fill = |points: &[(i32, i32)]| {
            let points: Vec<_> = points.iter().map(|(right, down)| (x + right, y + down)).collect();
            area.draw(&Polygon::new(points, colour.filled())).map_err(words)
        };
        let strokes = |strokes: [[(i32, i32); 2]; 2]| {
            for ends in strokes {
                let ends: Vec<_> = ends.iter().map(|(right, down)| (x + right, y + down)).collect();
                area.draw(&PathElement::new(ends, colour.stroke_width(2))).map_err(words)?;
            }
            Ok(())
        };
        match shape {
            0 => area.draw(&Circle::new((x, y), 4, colour.filled())).map_err(words),
            1 => fill(&[(-4, -4), (4, -4), (4, 4), (-4, 4)]),
            2 => fill(&[(0, -5), (5, 4), (-5, 4)]),
            3 => fill(&[(0, -6), (5, 0), (0, 6), (-5, 0)]),
            4 => fill(&[(0, 5), (5, -4), (-5, -4)]),
            5 => strokes([[(-4, -4), (4, 4)], [(-4, 4), (4, -4)]]),
            _ => strokes([[(-5, 0), (5, 0)], [(0, -5), (0, 5)]]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_grows_lighter() {
        let sequence = scale(&Range { first: 0.0, last: 1.0, is_log: false });
        let grey = |share: f64| {
            let RGBColor(r, g, b) = sequence(share);
            0.30 * f64::from(r) + 0.59 * f64::from(g) + 0.11 * f64::from(b)
        };
        let greys: Vec<f64> = (0..=100).map(|n| grey(n as f64 / 100.0)).collect();
        assert!(greys.windows(2).all(|pair| pair[0] < pair[1] + 0.5), "{greys:?}");
        assert_eq!(sequence(-1.0), sequence(0.0));
        assert_eq!(sequence(2.0), RGBColor(253, 231, 37));
        let signed = scale(&Range { first: -2.0, last: 2.0, is_log: false });
        let RGBColor(r, g, b) = signed(0.5);
        assert!(r.min(g).min(b) > 240);
    }
}
