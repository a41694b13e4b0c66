//! Solid and dashed lines.

use super::canvas::{At, Canvas, rounded};
use super::palette::Colour;

/// Lengths of a stroke, a gap, a stroke and a gap, px.
pub(super) type Dashes = [f64; 4];

/// Dashes of the references in turn.
pub(super) const REFERENCE_DASHES: [Dashes; 4] =
    [[8.0, 5.0, 8.0, 5.0], [2.0, 4.0, 2.0, 4.0], [9.0, 4.0, 2.0, 4.0], [16.0, 6.0, 16.0, 6.0]];
/// Dashes of a dashed series.
pub(super) const SERIES_DASHES: Dashes = [7.0, 4.0, 7.0, 4.0];

/// Draws a line through places; without a pattern it is solid.
pub(super) fn stroke(canvas: &mut Canvas, places: &[At], colour: Colour, width_px: u32, pattern: Option<Dashes>) {
    for stroke in pattern.map_or_else(|| vec![places.to_vec()], |pattern| dashes(places, pattern)) {
        let mut places: Vec<_> = stroke.into_iter().map(rounded).collect();
        places.dedup();
        canvas.line(places, colour, width_px);
    }
}

/// The strokes of a dashed line.
fn dashes(places: &[At], pattern: Dashes) -> Vec<Vec<At>> {
    let mut strokes = Vec::new();
    let (mut phase, mut left) = (0, pattern[0]);
    let mut stroke: Vec<At> = places.first().into_iter().copied().collect();
    for pair in places.windows(2) {
        let along = [0, 1].map(|axis| pair[1][axis] - pair[0][axis]);
        let length = along[0].hypot(along[1]);
        let mut done = 0.0;
        while length - done > left {
            done += left;
            let at = [0, 1].map(|axis| pair[0][axis] + along[axis] * done / length);
            if phase % 2 == 0 {
                stroke.push(at);
                strokes.push(std::mem::take(&mut stroke));
            } else {
                stroke = vec![at];
            }
            phase = (phase + 1) % 4;
            left = pattern[phase];
        }
        left -= length - done;
        if phase % 2 == 0 {
            stroke.push(pair[1]);
        }
    }
    if stroke.len() > 1 {
        strokes.push(stroke);
    }
    strokes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_have_their_length() {
        let strokes = dashes(&[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]], [4.0, 2.0, 1.0, 2.0]);
        let length = |stroke: &Vec<At>| -> f64 {
            stroke.windows(2).map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1])).sum()
        };
        let lengths: Vec<f64> = strokes.iter().map(length).collect();
        assert_eq!(lengths, [4.0, 1.0, 4.0, 1.0, 2.0]);
        assert_eq!(strokes[2], [[9.0, 0.0], [10.0, 0.0], [10.0, 3.0]]);
    }
}
