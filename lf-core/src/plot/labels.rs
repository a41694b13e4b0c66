//! Words beside points, where they cover nothing.

use super::chart::Mark;
use super::clip::At;
use super::marks::course;
use super::palette::GREY;
use super::text::{From, TEXT_PX, text, width};
use super::view::{View, rounded};
use super::{Area, Drawn, words};
use plotters::prelude::*;

/// Height of a word's box, px.
const HEIGHT: f64 = 16.0;
/// Distances from the point that are tried, px; from the third on a thin line leads to the point.
const DISTANCES: [f64; 7] = [8.0, 13.0, 22.0, 34.0, 48.0, 66.0, 88.0];
/// Directions that are tried, to the right first.
const DIRECTIONS: [[f64; 2]; 8] =
    [[1.0, 0.0], [0.7, -0.7], [0.7, 0.7], [-1.0, 0.0], [-0.7, -0.7], [-0.7, 0.7], [0.0, -1.0], [0.0, 1.0]];
/// Distance between the places of a line that a word keeps clear of, px.
const SAMPLE: f64 = 5.0;

/// A word's room: left, top, right, lower edge.
#[derive(Clone, Copy)]
struct Room {
    low: At,
    high: At,
}

impl Room {
    fn about(at: At, half: f64) -> Self {
        Self { low: at.map(|v| v - half), high: at.map(|v| v + half) }
    }

    fn meets(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.low[axis] < other.high[axis] && other.low[axis] < self.high[axis])
    }

    fn holds(&self, at: At) -> bool {
        (0..2).all(|axis| self.low[axis] < at[axis] && at[axis] < self.high[axis])
    }
}

/// Writes the labels of all points; counts those without room.
pub(super) fn labels(area: &Area, view: &View) -> Drawn<usize> {
    let (points, lines) = obstacles(view);
    let (mut written, mut leads): (Vec<Room>, Vec<At>) = (Vec::new(), Vec::new());
    let mut left_out = 0;
    for (at, label) in labelled(view) {
        let wide = f64::from(width(label, TEXT_PX));
        let rooms = || DISTANCES.into_iter().flat_map(|far| DIRECTIONS.map(|way| (far, beside(at, far, way, wide))));
        let is_free = |(far, room): &(f64, Room)| {
            view.frame.contains(room.low)
                && view.frame.contains(room.high)
                && !points.iter().chain(&written).any(|other| room.meets(other))
                && !leads.iter().any(|at| room.holds(*at))
                && !lead(at, *far, room).iter().any(|at| written.iter().any(|other| other.holds(*at)))
        };
        let clear = rooms().find(|room| is_free(room) && !lines.iter().any(|at| room.1.holds(*at)));
        let Some((far, room)) = clear.or_else(|| rooms().find(is_free)) else {
            left_out += 1;
            continue;
        };
        let way = lead(at, far, &room);
        if let [from, .., to] = way[..] {
            area.draw(&PathElement::new([from, to].map(rounded).to_vec(), GREY.stroke_width(1))).map_err(words)?;
        }
        let start = [room.low[0], 0.5 * (room.low[1] + room.high[1])];
        text(area, label, rounded(start), TEXT_PX, From::Left)?;
        leads.extend(way);
        written.push(room);
    }
    Ok(left_out)
}

/// Places along the thin line from a point to a word; none where the word is near.
fn lead(at: At, far: f64, room: &Room) -> Vec<At> {
    if far <= DISTANCES[1] {
        return Vec::new();
    }
    let nearest = [0, 1].map(|axis| at[axis].clamp(room.low[axis], room.high[axis]));
    along(at, nearest)
}

/// Places from one to another, both among them.
fn along(from: At, to: At) -> Vec<At> {
    let count = ((to[0] - from[0]).hypot(to[1] - from[1]) / SAMPLE).ceil().max(1.0);
    let at = |n: f64| [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * n / count);
    (0..=count as usize).map(|n| at(n as f64)).collect()
}

/// The room of a word so wide, so far from a point in a direction.
fn beside(at: At, far: f64, [right, down]: [f64; 2], wide: f64) -> Room {
    let middle = [at[0] + right * (far + 0.5 * wide), at[1] + down * (far + 0.5 * HEIGHT)];
    // Beside and not above the point, a slanted word starts at the point's side.
    let middle = if right.abs() < 1.0 && right != 0.0 {
        [at[0] + right.signum() * (0.7 * far + 0.5 * wide), middle[1]]
    } else {
        middle
    };
    let half = [0.5 * wide, 0.5 * HEIGHT];
    Room { low: [0, 1].map(|axis| middle[axis] - half[axis]), high: [0, 1].map(|axis| middle[axis] + half[axis]) }
}

fn labelled<'a>(view: &'a View) -> impl Iterator<Item = (At, &'a str)> {
    let lists = view.panel.marks.iter().filter_map(|mark| match mark {
        Mark::Points { points, labels: Some(labels), .. } => Some(points.iter().zip(labels)),
        _ => None,
    });
    let places = lists.flatten().map(|(point, label)| (view.at(*point), label.as_str()));
    places.filter(|(at, label)| view.frame.contains(*at) && !label.is_empty())
}

/// Room that points take, and places along lines, references and bars.
fn obstacles(view: &View) -> (Vec<Room>, Vec<At>) {
    let (mut rooms, mut lines) = (Vec::new(), Vec::new());
    let mut follow = |ends: &[At]| {
        let parts = view.frame.line(ends);
        lines.extend(parts.iter().flat_map(|part| part.windows(2)).flat_map(|pair| along(pair[0], pair[1])));
    };
    for mark in &view.panel.marks {
        match mark {
            Mark::Line { points, .. } => {
                follow(&points.iter().map(|point| view.at(*point)).collect::<Vec<At>>());
            }
            Mark::Points { points, spread, .. } => {
                let places = points.iter().map(|point| view.at(*point));
                rooms.extend(places.filter(|at| view.frame.contains(*at)).map(|at| Room::about(at, 5.0)));
                for (point, ends) in points.iter().zip(spread.iter().flatten()) {
                    follow(&ends.map(|y| view.at_or_below([point[0], y])));
                }
            }
            Mark::Reference { place, .. } => follow(&course(view, place)),
            _ => {}
        }
    }
    (rooms, lines)
}
