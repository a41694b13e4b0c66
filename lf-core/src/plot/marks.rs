//! What stands in a panel, from the back to the front.

use super::arrows::arrows;
use super::chart::{Mark, Place, Style};
use super::clip::{At, dashes};
use super::labels::labels;
use super::map;
use super::palette::{DASHES, GREY, Look, SERIES_DASH, SHADES};
use super::view::{Looks, View, reference_number, rounded};
use super::{Area, Drawn, words};
use plotters::prelude::*;

/// How many points of a line are marked to tell it from others.
const TELLING: usize = 5;

/// Shades, which stand behind the lines at the ticks.
pub(super) fn regions(area: &Area, view: &View) -> Drawn<()> {
    let regions = view.panel.marks.iter().filter_map(|mark| match mark {
        Mark::Region { x, .. } => Some(x),
        _ => None,
    });
    for (n, x) in regions.enumerate() {
        let [from, to] = x.map(|x| if x.is_finite() { view.x.share(x).clamp(0.0, 1.0) } else { f64::NAN });
        if from.is_nan() || to.is_nan() || from == to {
            continue;
        }
        let (low, high) = (view.frame.low, view.frame.high);
        let [from, to] = [from.min(to), from.max(to)].map(|share| low[0] + share * (high[0] - low[0]));
        let corners = [rounded([from, low[1]]), rounded([to, high[1]])];
        area.draw(&Rectangle::new(corners, SHADES[n % SHADES.len()].filled())).map_err(words)?;
    }
    Ok(())
}

/// Everything else. Labels that found no room are counted.
pub(super) fn marks(area: &Area, view: &View) -> Drawn<usize> {
    let marks = &view.panel.marks;
    for mark in marks {
        if let Mark::Map { .. } = mark {
            map::cells(area, view, mark)?;
        }
    }
    for mark in marks {
        if let Mark::Reference { name, place } = mark {
            reference(area, view, place, reference_number(view.panel, name))?;
        }
    }
    for mark in marks {
        if let Mark::Line { name, points, spread: Some(spread), .. } = mark {
            band(area, view, points, spread, view.looks.look(name))?;
        }
    }
    let several = Looks::of([view.panel]).0.len() > 1;
    for mark in marks {
        match mark {
            Mark::Line { name, points, style, with_points, .. } => {
                let look = view.looks.look(name);
                let places: Vec<At> = points.iter().map(|point| view.at(*point)).collect();
                line(area, view, &places, look, *style)?;
                match (with_points, several) {
                    (true, _) => markers(area, view, &places, look)?,
                    (false, true) => markers(area, view, &telling(view, &places, look), look)?,
                    (false, false) => markers(area, view, &lonely(&places), look)?,
                }
            }
            Mark::Steps { name, edges, values } => {
                let look = view.looks.look(name);
                line(area, view, &outline(view, edges, values), look, Style::Solid)?;
                if several {
                    let middles = edges.windows(2).zip(values);
                    let middles = middles.map(|(ends, value)| view.at([0.5 * (ends[0] + ends[1]), *value]));
                    markers(area, view, &telling(view, &middles.collect::<Vec<At>>(), look), look)?;
                }
            }
            Mark::Points { name, points, spread, .. } => {
                let look = view.looks.look(name);
                for (n, point) in points.iter().enumerate() {
                    if let Some(spread) = spread {
                        bar(area, view, point[0], spread[n], look)?;
                    }
                }
                let places: Vec<At> = points.iter().map(|point| view.at(*point)).collect();
                markers(area, view, &places, look)?;
            }
            Mark::Arrows { points, vectors } => arrows(area, view, points, vectors)?,
            Mark::Reference { .. } | Mark::Region { .. } | Mark::Map { .. } => {}
        }
    }
    labels(area, view)
}

/// A stroke through places, whole or in dashes.
pub(super) fn stroke(area: &Area, places: &[At], style: ShapeStyle, pattern: Option<[f64; 4]>) -> Drawn<()> {
    let strokes = pattern.map_or_else(|| vec![places.to_vec()], |pattern| dashes(places, pattern));
    for stroke in strokes {
        let mut places: Vec<(i32, i32)> = stroke.into_iter().map(rounded).collect();
        places.dedup();
        area.draw(&PathElement::new(places, style)).map_err(words)?;
    }
    Ok(())
}

fn line(area: &Area, view: &View, places: &[At], look: Look, style: Style) -> Drawn<()> {
    let pattern = (style == Style::Dashed).then_some(SERIES_DASH);
    for part in view.frame.line(places) {
        stroke(area, &part, look.colour().stroke_width(2), pattern)?;
    }
    Ok(())
}

/// The places that a reference goes through.
pub(super) fn course(view: &View, place: &Place) -> Vec<At> {
    let (low, high) = (view.frame.low, view.frame.high);
    match place {
        Place::Vertical(x) => [low[1], high[1]].map(|y| [view.at([*x, view.y.first])[0], y]).to_vec(),
        Place::Horizontal(y) => [low[0], high[0]].map(|x| [x, view.at([view.x.first, *y])[1]]).to_vec(),
        Place::Curve(points) => points.iter().map(|point| view.at(*point)).collect(),
    }
}

fn reference(area: &Area, view: &View, place: &Place, n: usize) -> Drawn<()> {
    for part in view.frame.line(&course(view, place)) {
        stroke(area, &part, GREY.stroke_width(2), Some(DASHES[n % DASHES.len()]))?;
    }
    Ok(())
}

fn markers(area: &Area, view: &View, places: &[At], look: Look) -> Drawn<()> {
    for place in places.iter().filter(|place| view.frame.contains(**place)) {
        look.marker(area, rounded(*place))?;
    }
    Ok(())
}

/// Points without a neighbour, which no line shows.
fn lonely(places: &[At]) -> Vec<At> {
    let is_finite = |n: usize| places.get(n).is_some_and(|place| place.iter().all(|value| value.is_finite()));
    let alone = |n: &usize| is_finite(*n) && !is_finite(n + 1) && !(*n > 0 && is_finite(n - 1));
    (0..places.len()).filter(alone).map(|n| places[n]).collect()
}

/// A few places along the panel, others for every look, so that markers do not hide each other.
fn telling(view: &View, places: &[At], look: Look) -> Vec<At> {
    let seen: Vec<At> = places.iter().copied().filter(|place| view.frame.contains(*place)).collect();
    let width = view.frame.high[0] - view.frame.low[0];
    let mut chosen: Vec<At> = Vec::new();
    for n in 0..TELLING {
        let share = (n as f64 + (0.5 + 0.37 * look.0 as f64).fract()) / TELLING as f64;
        let wanted = view.frame.low[0] + share * width;
        let nearest = seen.iter().min_by(|a, b| (a[0] - wanted).abs().total_cmp(&(b[0] - wanted).abs()));
        chosen.extend(nearest.filter(|place| !chosen.contains(place)));
    }
    chosen
}

/// The outline of a histogram from its foot to its foot.
fn outline(view: &View, edges: &[f64], values: &[f64]) -> Vec<At> {
    let mut places = Vec::with_capacity(2 * values.len() + 2);
    places.extend(edges.first().map(|edge| view.at_or_below([*edge, 0.0])));
    for (ends, value) in edges.windows(2).zip(values) {
        places.extend([ends[0], ends[1]].map(|edge| view.at_or_below([edge, *value])));
    }
    places.extend(edges.last().map(|edge| view.at_or_below([*edge, 0.0])));
    places
}

/// The area between least and greatest, in parts where points are missing; a bar where a part is one point.
fn band(area: &Area, view: &View, points: &[[f64; 2]], spread: &[[f64; 2]], look: Look) -> Drawn<()> {
    let whole = |n: &usize| {
        view.at(points[*n]).into_iter().chain(spread[*n]).all(f64::is_finite) && view.y.share(spread[*n][1]).is_finite()
    };
    let kept: Vec<usize> = (0..points.len()).filter(whole).collect();
    for part in kept.chunk_by(|one, other| one + 1 == *other) {
        if let [n] = part {
            bar(area, view, points[*n][0], spread[*n], look)?;
            continue;
        }
        let side = |n: &usize, end: usize| view.at_or_below([points[*n][0], spread[*n][end]]);
        let low = part.iter().map(|n| side(n, 0));
        let outline: Vec<At> = low.chain(part.iter().rev().map(|n| side(n, 1))).collect();
        let places: Vec<_> = view.frame.area(&outline).into_iter().map(rounded).collect();
        if places.len() > 2 {
            area.draw(&Polygon::new(places, look.colour().mix(0.2).filled())).map_err(words)?;
        }
    }
    Ok(())
}

/// An upright bar from least to greatest.
fn bar(area: &Area, view: &View, x: f64, spread: [f64; 2], look: Look) -> Drawn<()> {
    let ends = spread.map(|y| view.at_or_below([x, y]));
    for part in view.frame.line(&ends) {
        stroke(area, &part, look.colour().stroke_width(1), None)?;
    }
    for end in ends.into_iter().filter(|end| view.frame.contains(*end)) {
        stroke(area, &[[end[0] - 3.0, end[1]], [end[0] + 3.0, end[1]]], look.colour().stroke_width(1), None)?;
    }
    Ok(())
}
