//! Vectors in a panel.

use super::palette::INK;
use super::view::{View, rounded};
use super::{Area, Drawn, words};
use plotters::prelude::*;

/// Shorter than this it is a dot, px.
const DOT_PX: f64 = 2.0;

/// Arrows centred on their places.
pub(super) fn arrows(area: &Area, view: &View, points: &[[f64; 2]], vectors: &[[f64; 2]]) -> Drawn<()> {
    for (point, vector) in points.iter().zip(vectors) {
        let [from, to] = [-0.5, 0.5].map(|half| view.at([0, 1].map(|axis| point[axis] + half * vector[axis])));
        if from.iter().chain(&to).all(|place| place.is_finite()) && view.frame.contains(view.at(*point)) {
            arrow(area, from, to)?;
        }
    }
    Ok(())
}

fn arrow(area: &Area, from: [f64; 2], to: [f64; 2]) -> Drawn<()> {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0].hypot(along[1]);
    if length < DOT_PX {
        let middle = rounded([0, 1].map(|axis| 0.5 * (from[axis] + to[axis])));
        return area.draw(&Circle::new(middle, 1, INK.filled())).map_err(words);
    }
    let head = (0.4 * length).clamp(3.0, 9.0).min(length);
    let [x, y] = along.map(|part| part / length);
    // A place so far behind the tip, and so far beside the arrow.
    let point = |back: f64, side: f64| rounded([to[0] - back * x - side * y, to[1] - back * y + side * x]);
    let barb = 0.4 * head;
    area.draw(&PathElement::new(vec![rounded(from), point(head, 0.0)], INK.stroke_width(1))).map_err(words)?;
    area.draw(&Polygon::new(vec![point(head, barb), rounded(to), point(head, -barb)], INK.filled())).map_err(words)
}
