//! Colours for a signed value: blue below, near white at 0, red above.

use plotters::style::RGBColor;

/// What arrows and words are drawn in.
pub(super) const INK: RGBColor = RGBColor(25, 25, 35);
/// Replaced vectors.
pub(super) const GREY: RGBColor = RGBColor(95, 95, 95);
/// Cells without data, and the cross in them.
pub(super) const EMPTY: [RGBColor; 2] = [RGBColor(222, 222, 222), RGBColor(140, 140, 140)];

/// Colours at equal distances. Blue and red are told apart by most colour-blind eyes; both ends are light enough for ink.
const STOPS: [[u8; 3]; 7] = [
    [62, 118, 186],
    [126, 168, 214],
    [192, 213, 234],
    [248, 247, 244],
    [247, 208, 188],
    [230, 150, 124],
    [202, 86, 70],
];

/// The colour at `share` of the limit, -1 to 1; beyond it is as at the limit.
pub(super) fn colour(share: f64) -> RGBColor {
    let place = (0.5 + 0.5 * share.clamp(-1.0, 1.0)) * (STOPS.len() - 1) as f64;
    let low = (place as usize).min(STOPS.len() - 2);
    let part = place - low as f64;
    let [r, g, b] = std::array::from_fn(|c| {
        (STOPS[low][c] as f64 + part * (STOPS[low + 1][c] as f64 - STOPS[low][c] as f64)).round() as u8
    });
    RGBColor(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_pale_and_the_ends_are_not() {
        let RGBColor(r, g, b) = colour(0.0);
        assert!(r.min(g).min(b) > 240);
        let [RGBColor(red, _, blue), RGBColor(red_above, _, blue_above)] = [colour(-9.0), colour(1.0)];
        assert!(blue > red + 100 && red_above > blue_above + 100);
    }
}
