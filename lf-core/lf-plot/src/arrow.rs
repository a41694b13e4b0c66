//! Arrows, and the vectors that they stand for.

use super::chart::Arrows;
use super::drawing::{At, Drawing, rounded};
use super::palette::{GREY, INK, PAPER};
use super::text::{figures, round_below};

/// Length below which an arrow becomes a dot, and a hollow one a ring, px.
const DOT_PX: f64 = 2.0;
const RING_PX: f64 = 5.0;
/// Length of a usual arrow, in distances between arrows, and its upper limit, px. The longest arrow is then as long as
/// that distance, so that no two of one grid meet.
const USUAL_STEPS: f64 = 0.62;
const USUAL_PX: f64 = 80.0;
/// Longest arrow, in usual lengths.
const LONGEST: f64 = 1.6;
/// Smallest length of the arrow in the key before it is rounded down, px.
const SAMPLE_PX: f64 = 48.0;

impl Arrows {
    /// Draws the arrows. `px_per_unit` is that of the axes to the right and upwards; `at` is the place of a point, None
    /// outside the frame.
    pub fn draw(&self, drawing: &mut Drawing, px_per_unit: [f64; 2], at: impl Fn([f64; 2]) -> Option<At>) {
        let px = self.px(px_per_unit);
        for (point, vector) in self.points.iter().zip(&self.vectors) {
            let is_finite = vector.iter().all(|component| component.is_finite());
            let Some(middle) = at(*point).filter(|_| is_finite) else { continue };
            let cut = self.excess(vector).max(1.0);
            let half = [0, 1].map(|axis| 0.5 * vector[axis] * px * px_per_unit[axis].signum() / cut);
            let [from, to] = [-1.0, 1.0].map(|sign| [middle[0] + sign * half[0], middle[1] - sign * half[1]]);
            arrow(drawing, from, to, self.is_hollow);
        }
    }

    /// A round length for the key: that of its arrow, px, and its value with the unit. None if all arrows are dots.
    pub fn sample(&self, px_per_unit: [f64; 2]) -> Option<(f64, String)> {
        let px = self.px(px_per_unit);
        let length = round_below((self.usual * px).max(SAMPLE_PX) / px);
        (px > 0.0).then(|| (length * px, format!("{} {}", figures(length), self.unit)))
    }

    pub(super) fn count_cut_short(&self) -> usize {
        self.vectors.iter().filter(|vector| self.excess(vector) > 1.0).count()
    }

    /// Length in px of the arrow of a vector of unit length.
    fn px(&self, px_per_unit: [f64; 2]) -> f64 {
        let [x, y] = [0, 1].map(|axis| USUAL_STEPS * self.spacing[axis] * px_per_unit[axis].abs());
        if self.usual > 0.0 { x.min(y).min(USUAL_PX) / self.usual } else { 0.0 }
    }

    /// Length of a vector as a share of the longest one that is drawn whole.
    fn excess(&self, [x, y]: &[f64; 2]) -> f64 {
        if self.usual > 0.0 { x.hypot(*y) / (LONGEST * self.usual) } else { 0.0 }
    }
}

/// Draws an arrow between two places, in ink; a hollow one is a grey outline.
pub fn arrow(drawing: &mut Drawing, from: At, to: At, is_hollow: bool) {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0].hypot(along[1]);
    let middle = rounded([0, 1].map(|axis| 0.5 * (from[axis] + to[axis])));
    if is_hollow && length < RING_PX {
        drawing.disc(middle, 3, PAPER);
        return drawing.ring(middle, 3, GREY);
    }
    if length < DOT_PX {
        return drawing.disc(middle, 1, INK);
    }

    // `point(back, side)` lies `back` px behind the tip and `side` px beside the arrow.
    let [x, y] = along.map(|component| component / length);
    let point = |back: f64, side: f64| rounded([to[0] - back * x - side * y, to[1] - back * y + side * x]);
    let head = (0.4 * length).clamp(3.0, 9.0).min(length);
    let barb = 0.4 * head;
    if is_hollow {
        let (barb, shaft) = (barb.max(3.0), 1.5);
        let side = [(length, shaft), (head, shaft), (head, barb)].map(|(back, side)| point(back, side));
        let other = [(head, -barb), (head, -shaft), (length, -shaft)].map(|(back, side)| point(back, side));
        let outline: Vec<_> = side.into_iter().chain([rounded(to)]).chain(other).chain([side[0]]).collect();
        drawing.polygon(outline.clone(), PAPER);
        return drawing.line(outline, GREY, 1);
    }
    drawing.line([rounded(from), point(head, 0.0)], INK, 1);
    drawing.polygon([point(head, barb), rounded(to), point(head, -barb)], INK);
}
