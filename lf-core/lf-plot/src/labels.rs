//! Labels beside points, at places where they cover nothing.

use super::drawing::{At, Drawing, rounded};
use super::text::{Anchor, TEXT_PX, width};
use super::{chart::Mark, palette::GREY, px_box::PxBox, view::PanelView};

/// Height of a label's box, px.
const HEIGHT: f64 = 16.0;
/// Distances from the point that are tried, px. From the third on, a thin leader joins label and point.
const DISTANCES: [f64; 7] = [8.0, 13.0, 22.0, 34.0, 48.0, 66.0, 88.0];
/// Directions that are tried, the right first.
const DIRECTIONS: [[f64; 2]; 8] =
    [[1.0, 0.0], [0.7, -0.7], [0.7, 0.7], [-1.0, 0.0], [-0.7, -0.7], [-0.7, 0.7], [0.0, -1.0], [0.0, 1.0]];
/// Distance between the places of a line that a label must not cover, px.
const SAMPLE_PX: f64 = 5.0;

/// Writes the labels of all points. Returns the number of labels that find no free place.
pub(super) fn labels(drawing: &mut Drawing, view: &PanelView) -> usize {
    let (points, lines) = obstacles(view);
    let (mut written, mut leaders): (Vec<PxBox>, Vec<At>) = (Vec::new(), Vec::new());
    let mut left_out = 0;
    for (at, label) in labelled(view) {
        let wide = f64::from(width(label, TEXT_PX));
        let candidates =
            || DISTANCES.into_iter().flat_map(|far| DIRECTIONS.map(|way| (far, beside(at, far, way, wide))));
        let is_free = |(far, label): &(f64, PxBox)| {
            view.frame.contains(label.low)
                && view.frame.contains(label.high)
                && !points.iter().chain(&written).any(|other| label.meets(other))
                && !leaders.iter().any(|at| label.holds(*at))
                && !leader(at, *far, label).iter().any(|at| written.iter().any(|other| other.holds(*at)))
        };
        // A label may cover a line if it has no other place.
        let clear = candidates().find(|label| is_free(label) && !lines.iter().any(|at| label.1.holds(*at)));
        let Some((far, place)) = clear.or_else(|| candidates().find(is_free)) else {
            left_out += 1;
            continue;
        };
        let leader = leader(at, far, &place);
        if let [from, .., to] = leader[..] {
            drawing.line([from, to].map(rounded), GREY, 1);
        }
        let start = [place.low[0], 0.5 * (place.low[1] + place.high[1])];
        drawing.text(label, rounded(start), TEXT_PX, Anchor::Left);
        leaders.extend(leader);
        written.push(place);
    }
    left_out
}

/// Places along the leader from a point to its label; none if the label is near.
fn leader(at: At, far: f64, label: &PxBox) -> Vec<At> {
    if far <= DISTANCES[1] {
        return Vec::new();
    }
    let nearest = [0, 1].map(|axis| at[axis].clamp(label.low[axis], label.high[axis]));
    along(at, nearest)
}

/// Places from one to another, including both.
fn along(from: At, to: At) -> Vec<At> {
    let count = ((to[0] - from[0]).hypot(to[1] - from[1]) / SAMPLE_PX).ceil().max(1.0);
    let at = |n: f64| [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * n / count);
    (0..=count as usize).map(|n| at(n as f64)).collect()
}

/// The box of a label of width `wide` at the distance `far` from a point, in a direction.
fn beside(at: At, far: f64, [right, down]: [f64; 2], wide: f64) -> PxBox {
    let mut middle = [at[0] + right * (far + 0.5 * wide), at[1] + down * (far + 0.5 * HEIGHT)];
    // In an oblique direction the label starts beside the point, not above it.
    if right.abs() < 1.0 && right != 0.0 {
        middle[0] = at[0] + right.signum() * (0.7 * far + 0.5 * wide);
    }
    PxBox::about(middle, [0.5 * wide, 0.5 * HEIGHT])
}

fn labelled<'a>(view: &'a PanelView) -> impl Iterator<Item = (At, &'a str)> {
    let lists = view.panel.marks.iter().filter_map(|mark| match mark {
        Mark::Points { points, labels: Some(labels), .. } => Some(points.iter().zip(labels)),
        _ => None,
    });
    let places = lists.flatten().map(|(point, label)| (view.at(*point), label.as_str()));
    places.filter(|(at, label)| view.frame.contains(*at) && !label.is_empty())
}

/// Boxes of points, and places along lines, references and bars.
fn obstacles(view: &PanelView) -> (Vec<PxBox>, Vec<At>) {
    let (mut boxes, mut lines) = (Vec::new(), Vec::new());
    let mut follow = |ends: &[At]| {
        let parts = view.frame.line(ends);
        lines.extend(parts.iter().flat_map(|part| part.windows(2)).flat_map(|pair| along(pair[0], pair[1])));
    };
    for mark in &view.panel.marks {
        match mark {
            Mark::Line { points, .. } => follow(&view.places(points)),
            Mark::Points { points, spread, .. } => {
                let places = points.iter().map(|point| view.at(*point));
                boxes.extend(places.filter(|at| view.frame.contains(*at)).map(|at| PxBox::about(at, [5.0; 2])));
                for (point, ends) in points.iter().zip(spread.iter().flatten()) {
                    follow(&ends.map(|y| view.at_or_below([point[0], y])));
                }
            }
            Mark::Reference { place, .. } => follow(&view.reference(place)),
            _ => {}
        }
    }
    (boxes, lines)
}
