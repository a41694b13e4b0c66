//! The marks of a panel, from the back to the front.

use super::chart::{Mark, Style};
use super::drawing::{At, Drawing, rounded};
use super::map;
use super::palette::{GREY, REFERENCE_DASHES, SERIES_DASHES, SHADE};
use super::view::{Look, PanelView, has_many_series, reference_number};

/// Number of marked points of a line, if they only distinguish it from other lines.
const FEW_MARKERS: usize = 5;

/// Draws the regions, which lie below the grid lines.
pub(super) fn regions(drawing: &mut Drawing, view: &PanelView) {
    let regions = view.panel.marks.iter().filter_map(|mark| match mark {
        Mark::Region { x, .. } => Some(x),
        _ => None,
    });
    for x in regions {
        let [from, to] = x.map(|x| if x.is_finite() { view.x.share(x).clamp(0.0, 1.0) } else { f64::NAN });
        if from.is_nan() || to.is_nan() || from == to {
            continue;
        }
        let (low, high) = (view.frame.low, view.frame.high);
        let [from, to] = [from.min(to), from.max(to)].map(|share| low[0] + share * (high[0] - low[0]));
        drawing.block([rounded([from, low[1]]), rounded([to, high[1]])], SHADE);
    }
}

/// Draws all other marks.
pub(super) fn marks(drawing: &mut Drawing, view: &PanelView) {
    let marks = &view.panel.marks;
    for mark in marks {
        map::cells(drawing, view, mark);
    }
    for mark in marks {
        if let Mark::Reference { name, place } = mark {
            let dashes = REFERENCE_DASHES[reference_number(view.panel, name) % REFERENCE_DASHES.len()];
            for part in view.frame.line(&view.reference(place)) {
                drawing.curve(&part, GREY, 2, Some(dashes));
            }
        }
    }
    for mark in marks {
        series(drawing, view, mark);
    }
}

fn series(drawing: &mut Drawing, view: &PanelView, mark: &Mark) {
    let look = view.looks.look(mark.name());
    let has_many = has_many_series(view.panel);
    match mark {
        Mark::Line { points, style, .. } => {
            let places = view.places(points);
            line(drawing, view, &places, look, *style);
            let marked = if has_many { few(view, &places, look) } else { isolated(&places) };
            markers(drawing, view, &marked, look);
        }
        Mark::Steps { edges, values, .. } => {
            line(drawing, view, &outline(view, edges, values), look, Style::Solid);
            if has_many {
                let bins = edges.windows(2).zip(values);
                let middles: Vec<At> = bins.map(|(ends, value)| view.at([0.5 * (ends[0] + ends[1]), *value])).collect();
                markers(drawing, view, &few(view, &middles, look), look);
            }
        }
        Mark::Arrows(arrows) => {
            arrows.draw(drawing, view.px_per_unit(), |point| Some(view.at(point)).filter(|at| view.frame.contains(*at)))
        }
        Mark::Reference { .. } | Mark::Region { .. } | Mark::Map { .. } => {}
    }
}

fn line(drawing: &mut Drawing, view: &PanelView, places: &[At], look: Look, style: Style) {
    let pattern = (style == Style::Dashed).then_some(SERIES_DASHES);
    for part in view.frame.line(places) {
        drawing.curve(&part, look.colour(), 2, pattern);
    }
}

fn markers(drawing: &mut Drawing, view: &PanelView, places: &[At], look: Look) {
    for place in places.iter().filter(|place| view.frame.contains(**place)) {
        look.marker(drawing, rounded(*place));
    }
}

/// Points without a neighbour, which a line does not show.
fn isolated(places: &[At]) -> Vec<At> {
    let is_finite = |n: usize| places.get(n).is_some_and(|place| place.iter().all(|value| value.is_finite()));
    let is_alone = |n: &usize| is_finite(*n) && !is_finite(n + 1) && !(*n > 0 && is_finite(n - 1));
    (0..places.len()).filter(is_alone).map(|n| places[n]).collect()
}

/// A few places along the panel. They differ from look to look, so that markers do not hide each other.
fn few(view: &PanelView, places: &[At], look: Look) -> Vec<At> {
    let seen: Vec<At> = places.iter().copied().filter(|place| view.frame.contains(*place)).collect();
    let width = view.frame.high[0] - view.frame.low[0];
    let mut chosen: Vec<At> = Vec::new();
    for n in 0..FEW_MARKERS {
        let share = (n as f64 + (0.5 + 0.37 * look.0 as f64).fract()) / FEW_MARKERS as f64;
        let wanted = view.frame.low[0] + share * width;
        let nearest = seen.iter().min_by(|a, b| (a[0] - wanted).abs().total_cmp(&(b[0] - wanted).abs()));
        chosen.extend(nearest.filter(|place| !chosen.contains(place)));
    }
    chosen
}

/// The outline of a histogram, from its foot at the left to its foot at the right.
fn outline(view: &PanelView, edges: &[f64], values: &[f64]) -> Vec<At> {
    let foot = |edge: Option<&f64>| edge.map(|edge| view.at_or_below([*edge, 0.0]));
    let bins = edges.windows(2).zip(values);
    let tops = bins.flat_map(|(ends, value)| [ends[0], ends[1]].map(|edge| view.at_or_below([edge, *value])));
    foot(edges.first()).into_iter().chain(tops).chain(foot(edges.last())).collect()
}
