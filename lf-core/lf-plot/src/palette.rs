//! The one table of colours and dashes. They differ for any eyes and in grey print.

use super::range::Range;

/// Red, green and blue, 0 to 255.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

/// Lengths of a dash, a gap, a dash and a gap, px.
pub(super) type Dashes = [u8; 4];

/// Text, frames, arrows.
pub const INK: Colour = Colour(25, 25, 35);
/// References, and the outlines of hollow arrows.
pub(super) const GREY: Colour = Colour(115, 115, 120);
pub(super) const GRID: Colour = Colour(232, 232, 236);
/// Cells of a map without a value.
pub(super) const EMPTY: Colour = Colour(205, 205, 205);
/// The page, and the inside of hollow arrows.
pub(super) const PAPER: Colour = Colour(255, 255, 255);
/// Regions.
pub(super) const SHADE: Colour = Colour(250, 240, 205);

/// Series in turn. Source: the colours of Okabe and Ito (2008) without yellow, which is faint on white.
pub const COLOURS: [Colour; 7] = [
    Colour(0, 114, 178),
    Colour(213, 94, 0),
    Colour(0, 158, 115),
    Colour(204, 121, 167),
    Colour(230, 159, 0),
    Colour(86, 180, 233),
    Colour(25, 25, 35),
];

/// Dashes of the references in turn.
pub(super) const REFERENCE_DASHES: [Dashes; 4] = [[8, 5, 8, 5], [2, 4, 2, 4], [9, 4, 2, 4], [16, 6, 16, 6]];
/// Dashes of a dashed series.
pub(super) const SERIES_DASHES: Dashes = [7, 4, 7, 4];

/// Maps. Source: nine evenly spaced colours of viridis (van der Walt and Smith 2015); linear between them.
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

/// Maps of values about 0: blue, white, red. The ends differ for nearly all colour-blind eyes, and both are light
/// enough for ink.
const SIGNED: [[f64; 3]; 7] = [
    [62.0, 118.0, 186.0],
    [126.0, 168.0, 214.0],
    [192.0, 213.0, 234.0],
    [248.0, 247.0, 244.0],
    [247.0, 208.0, 188.0],
    [230.0, 150.0, 124.0],
    [202.0, 86.0, 70.0],
];

/// The colours of a map by share of its scale, 0 to 1: [`SIGNED`] if `range` is symmetric about 0, else [`SEQUENCE`].
pub(super) fn map_colours(range: &Range) -> fn(f64) -> Colour {
    if range.first == -range.last { |share| between(&SIGNED, share) } else { |share| between(&SEQUENCE, share) }
}

/// Black at 0, white at 1.
pub fn grey(share: f64) -> Colour {
    let level = (255.0 * share.clamp(0.0, 1.0)) as u8;
    Colour(level, level, level)
}

fn between(colours: &[[f64; 3]], share: f64) -> Colour {
    let place = share.clamp(0.0, 1.0) * (colours.len() - 1) as f64;
    let below = (place as usize).min(colours.len() - 2);
    let [r, g, b] = [0, 1, 2].map(|channel| {
        let [low, high] = [colours[below][channel], colours[below + 1][channel]];
        (low + (high - low) * (place - below as f64)).round() as u8
    });
    Colour(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_grows_lighter() {
        let sequence = map_colours(&Range { first: 0.0, last: 1.0, is_log: false });
        let grey = |share: f64| {
            let Colour(r, g, b) = sequence(share);
            0.30 * f64::from(r) + 0.59 * f64::from(g) + 0.11 * f64::from(b)
        };
        let greys: Vec<f64> = (0..=100).map(|n| grey(n as f64 / 100.0)).collect();
        assert!(greys.windows(2).all(|pair| pair[0] < pair[1] + 0.5), "{greys:?}");
        assert_eq!(sequence(-1.0), sequence(0.0));
        assert_eq!(sequence(2.0), Colour(253, 231, 37));
    }

    #[test]
    fn zero_is_pale_and_the_ends_of_a_signed_scale_are_blue_and_red() {
        let signed = map_colours(&Range { first: -2.0, last: 2.0, is_log: false });
        let Colour(r, g, b) = signed(0.5);
        assert!(r.min(g).min(b) > 240);
        let [Colour(red, _, blue), Colour(red_above, _, blue_above)] = [signed(-9.0), signed(1.0)];
        assert!(blue > red + 100 && red_above > blue_above + 100);
    }
}
