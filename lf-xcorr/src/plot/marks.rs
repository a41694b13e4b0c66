//! What stands in the chart: coloured cells, arrows, places without data.

use super::palette::{EMPTY, GREY, INK, colour};
use super::view::View;
use super::{Area, Drawn, words};
use lf_core::field::{MEASURED, NO_DATA};
use plotters::prelude::*;

/// Longest arrow, in usual lengths: longer ones are cut to it and keep their direction.
const LONGEST: f64 = 1.6;

/// Every cell in the colour of the component through the plane, or empty.
pub(super) fn cells(area: &Area, view: &View) -> Drawn<()> {
    let (shape, stride) = (view.shape(), view.cell_stride());
    for j in (0..shape[1]).step_by(stride[1]) {
        for i in (0..shape[0]).step_by(stride[0]) {
            let end = [(i + stride[0]).min(shape[0]), (j + stride[1]).min(shape[1])];
            let node = view.node([(i + end[0]) / 2, (j + end[1]) / 2]);
            let corners = [[i, j], end].map(|corner| rounded(view.place_px(corner.map(|n| n as f64))));
            if view.field.flag[node] == NO_DATA {
                empty(area, corners)?;
                continue;
            }
            let share = if view.limit > 0.0 { view.value(view.through, node) / view.limit } else { 0.0 };
            area.draw(&Rectangle::new(corners, colour(share).filled())).map_err(words)?;
        }
    }
    Ok(())
}

/// The component in the plane.
pub(super) fn arrows(area: &Area, view: &View) -> Drawn<()> {
    let [_, scale] = view.arrow_px();
    for node_at in arrow_places(view) {
        let node = view.node(node_at);
        if view.field.flag[node] == NO_DATA {
            continue;
        }
        let centre = view.place_px(node_at.map(|n| n as f64 + 0.5));
        let half = view.on_canvas(node).map(|value| 0.5 * value * scale / excess(view, node).max(1.0));
        let [from, to] = [-1.0, 1.0].map(|sign| [0, 1].map(|a| centre[a] + sign * half[a]));
        arrow(area, from, to, view.field.flag[node] == MEASURED)?;
    }
    Ok(())
}

/// Arrows that are cut to [`LONGEST`].
pub(super) fn cut_short(view: &View) -> usize {
    let nodes = arrow_places(view).map(|place| view.node(place));
    nodes.filter(|&node| view.field.flag[node] != NO_DATA && excess(view, node) > 1.0).count()
}

/// Length of an arrow, share of the longest that is drawn; 0 where the field is at rest.
fn excess(view: &View, node: usize) -> f64 {
    if view.usual > 0.0 { view.length(node) / (LONGEST * view.usual) } else { 0.0 }
}

/// Columns and rows with an arrow: in the middle of those that are left out.
fn arrow_places(view: &View) -> impl Iterator<Item = [usize; 2]> {
    let (shape, stride) = (view.shape(), view.arrow_stride());
    let along = move |a: usize| ((shape[a] - 1) % stride[a] / 2..shape[a]).step_by(stride[a]);
    along(1).flat_map(move |j| along(0).map(move |i| [i, j]))
}

/// An arrow between two places, pixels: solid ink where measured, hollow and grey where replaced; a dot if it is short.
pub(super) fn arrow(area: &Area, from: [f64; 2], to: [f64; 2], is_measured: bool) -> Drawn<()> {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0].hypot(along[1]);
    if length < if is_measured { 2.0 } else { 5.0 } {
        let middle = rounded([0, 1].map(|a| 0.5 * (from[a] + to[a])));
        if is_measured {
            return area.draw(&Circle::new(middle, 1, INK.filled())).map_err(words);
        }
        area.draw(&Circle::new(middle, 3, WHITE.filled())).map_err(words)?;
        return area.draw(&Circle::new(middle, 3, GREY)).map_err(words);
    }
    let head = (0.4 * length).clamp(4.0, 11.0).min(length);
    let [x, y] = along.map(|a| a / length);
    // A place so far behind the tip, and so far beside the arrow.
    let point = |back: f64, side: f64| rounded([to[0] - back * x - side * y, to[1] - back * y + side * x]);
    let barb = 0.42 * head;
    if is_measured {
        let shaft = vec![rounded(from), point(head, 0.0)];
        area.draw(&PathElement::new(shaft, INK.stroke_width(2))).map_err(words)?;
        return area
            .draw(&Polygon::new(vec![point(head, barb), rounded(to), point(head, -barb)], INK.filled()))
            .map_err(words);
    }
    let (barb, shaft) = (barb.max(3.0), 1.5);
    let outline = vec![
        point(length, shaft),
        point(head, shaft),
        point(head, barb),
        rounded(to),
        point(head, -barb),
        point(head, -shaft),
        point(length, -shaft),
        point(length, shaft),
    ];
    area.draw(&Polygon::new(outline.clone(), WHITE.filled())).map_err(words)?;
    area.draw(&PathElement::new(outline, GREY)).map_err(words)
}

/// A grey cell with a cross.
pub(super) fn empty(area: &Area, corners: [(i32, i32); 2]) -> Drawn<()> {
    let [(left, one), (right, other)] = corners;
    let (top, bottom) = (one.min(other), one.max(other));
    area.draw(&Rectangle::new([(left, top), (right, bottom)], EMPTY[0].filled())).map_err(words)?;
    let half = ((right - left).min(bottom - top) / 4).min(5);
    if half < 1 {
        return Ok(());
    }
    let (x, y) = ((left + right) / 2, (top + bottom) / 2);
    for stroke in [[(x - half, y - half), (x + half, y + half)], [(x - half, y + half), (x + half, y - half)]] {
        area.draw(&PathElement::new(stroke, EMPTY[1])).map_err(words)?;
    }
    Ok(())
}

fn rounded([x, y]: [f64; 2]) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}
