//! The ends of an axis, where a value lies between them, and which ends fit the marks of a panel.

use super::chart::{Axis, Mark, Panel, Place};

/// The two ends of an axis; the first may be the greater one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub first: f64,
    pub last: f64,
    pub is_log: bool,
}

impl Range {
    /// A value's share of the axis: 0 at the first end, 1 at the last. NaN for a value that has no place on the axis.
    pub fn share(&self, value: f64) -> f64 {
        let along = |value: f64| if self.is_log { value.ln() } else { value };
        let share = (along(value) - along(self.first)) / (along(self.last) - along(self.first));
        // The logarithm of 0 is infinite. Ten lengths of the axis away is far enough for a clipped line.
        if share.is_finite() { share.clamp(-10.0, 11.0) } else { f64::NAN }
    }

    pub fn value(&self, share: f64) -> f64 {
        if self.is_log {
            (self.first.ln() + share * (self.last.ln() - self.first.ln())).exp()
        } else {
            self.first + share * (self.last - self.first)
        }
    }

    pub fn low(&self) -> f64 {
        self.first.min(self.last)
    }

    pub fn high(&self) -> f64 {
        self.first.max(self.last)
    }

    /// Whether a value lies on the axis, up to rounding.
    pub fn contains(&self, value: f64) -> bool {
        (-1e-9..=1.0 + 1e-9).contains(&self.share(value))
    }
}

/// Margin beyond the data, as a share of their span.
const MARGIN: f64 = 0.05;

/// Largest ratio of the sides of a panel that is drawn to scale. A flatter one is stretched to it.
const FLATTEST: f64 = 6.0;

/// How many times longer than to scale the two sides of a panel are drawn: 1, or more for the shorter side of a flat
/// panel.
pub(super) fn stretch(spans: [f64; 2]) -> [f64; 2] {
    [spans[1] / (FLATTEST * spans[0]), spans[0] / (FLATTEST * spans[1])].map(|factor| factor.max(1.0))
}

/// The ranges of x and y. None if the axis has no range and the panel no data for it.
pub(super) fn ranges(panel: &Panel) -> [Option<Range>; 2] {
    let x = range(panel, 0, &|_| true);
    let seen = |value: f64| x.is_none_or(|x| panel.x.range.is_none() || (0.0..=1.0).contains(&x.share(value)));
    [x, range(panel, 1, &seen)]
}

/// The range of an axis with these values, and a margin at both ends as a share of their span.
pub(super) fn range_of(values: impl Iterator<Item = f64>, axis: &Axis, margin: [f64; 2]) -> Option<Range> {
    let is_log = axis.is_log;
    if let Some([first, last]) = axis.range {
        return Some(Range { first, last, is_log });
    }
    let values = values.filter(|value| axis.holds(*value));
    let ends = values.fold(None, |ends: Option<[f64; 2]>, value| {
        Some(ends.map_or([value; 2], |[low, high]| [low.min(value), high.max(value)]))
    });
    let [low, high] = ends?;
    let bare = Range { first: low, last: high, is_log };
    if high - low > 1e-12 * high.abs().max(low.abs()) {
        return Some(Range { first: bare.value(-margin[0]), last: bare.value(1.0 + margin[1]), is_log });
    }
    let (first, last) = match (is_log, low == 0.0) {
        (true, _) => (low / 1.5, high * 1.5),
        (false, true) => (-1.0, 1.0),
        (false, false) => (low - 0.25 * low.abs(), high + 0.25 * high.abs()),
    };
    Some(Range { first, last, is_log })
}

/// The range of x (`which` = 0) or y (1). `seen` says whether x is shown.
fn range(panel: &Panel, which: usize, seen: &dyn Fn(f64) -> bool) -> Option<Range> {
    let axis = [&panel.x, &panel.y][which];
    let has = |wanted: fn(&Mark) -> bool| panel.marks.iter().any(wanted);
    let has_map = has(|mark| matches!(mark, Mark::Map { .. }));
    let has_steps = has(|mark| matches!(mark, Mark::Steps { .. }));
    let mut values: Vec<f64> = panel.marks.iter().flat_map(|mark| values(mark, panel, which, seen)).collect();
    if !values.iter().any(|value| axis.holds(*value)) {
        let curves = panel.marks.iter().filter_map(|mark| match mark {
            Mark::Reference { place: Place::Curve(points), .. } => Some(points),
            _ => None,
        });
        values.extend(curves.flatten().filter(|point| seen(point[0])).map(|point| point[which]));
    }
    let from_zero = which == 1 && has_steps && !axis.is_log && !values.iter().any(|value| *value < 0.0);
    let margin = match (has_map, has_steps, which) {
        (true, _, _) | (_, true, 0) => [0.0; 2],
        _ if from_zero => [0.0, MARGIN],
        _ => [MARGIN; 2],
    };
    let mut range = range_of(values.into_iter(), axis, margin)?;
    if from_zero && axis.range.is_none() && range.first < 0.0 {
        (range.first, range.last) = (0.0, range.last.max(1.0));
    }
    Some(range)
}

/// The values of a mark that have to fit on the axis.
fn values(mark: &Mark, panel: &Panel, which: usize, seen: &dyn Fn(f64) -> bool) -> Vec<f64> {
    match mark {
        Mark::Line { points, .. } => {
            let is_shown = |[x, y]: &&[f64; 2]| panel.x.holds(*x) && panel.y.holds(*y) && seen(*x);
            points.iter().filter(is_shown).map(|point| point[which]).collect()
        }
        Mark::Steps { edges, .. } if which == 0 => edges.clone(),
        Mark::Steps { edges, values, .. } => {
            let seen_bins = (0..values.len()).filter(|n| seen(edges[*n]) || seen(edges[n + 1]));
            seen_bins.map(|n| values[n]).chain([0.0]).collect()
        }
        Mark::Reference { place: Place::Vertical(x), .. } if which == 0 => vec![*x],
        Mark::Reference { place: Place::Horizontal(y), .. } if which == 1 => vec![*y],
        Mark::Arrows(arrows) => arrows.points.iter().map(|point| point[which]).collect(),
        Mark::Map { x, y, .. } => [x, y][which].to_vec(),
        Mark::Reference { .. } | Mark::Region { .. } => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_values_are_inverse() {
        for range in [Range { first: -2.0, last: 6.0, is_log: false }, Range { first: 100.0, last: 0.1, is_log: true }]
        {
            assert!((range.share(range.value(0.3)) - 0.3).abs() < 1e-12);
            assert!(range.share(f64::NAN).is_nan());
        }
        assert!(Range { first: 0.1, last: 1.0, is_log: true }.share(-1.0).is_nan());
    }

    fn ends(panel: &Panel) -> [[f64; 2]; 2] {
        ranges(panel).map(|range| range.map_or([f64::NAN; 2], |range| [range.first, range.last]))
    }

    #[test]
    fn data_have_a_margin_and_histograms_stand_on_zero() {
        let mut panel = Panel::new("", Axis::new("x"), Axis::new("y"));
        panel.marks = vec![Mark::line("", vec![[0.0, 10.0], [20.0, 30.0], [f64::NAN, 1e9]])];
        let near = |found: [[f64; 2]; 2], wanted: [[f64; 2]; 2]| {
            let pairs = found.iter().flatten().zip(wanted.iter().flatten());
            assert!(pairs.clone().all(|(found, wanted)| (found - wanted).abs() < 1e-9), "{found:?}");
        };
        near(ends(&panel), [[-1.0, 21.0], [9.0, 31.0]]);
        panel.marks = vec![Mark::Steps { name: "".into(), edges: vec![1.0, 2.0, 3.0], values: vec![4.0, 20.0] }];
        near(ends(&panel), [[1.0, 3.0], [0.0, 21.0]]);
    }

    #[test]
    fn y_fits_the_points_in_the_range_of_x() {
        let mut panel = Panel::new("", Axis::new("x").over([0.0, 5.0]), Axis::log("y"));
        panel.marks = vec![Mark::line("", vec![[0.0, 1.0], [5.0, 2.0], [9.0, 1e9], [3.0, -4.0]])];
        let [x, y] = ends(&panel);
        assert_eq!(x, [0.0, 5.0]);
        assert!(y[0] > 0.9 && y[1] < 2.2, "{y:?}");
    }

    #[test]
    fn one_value_has_a_range_and_no_value_has_none() {
        for (value, is_log) in [(0.0, false), (-3.0, false), (5.0, true)] {
            let axis = Axis { is_log, ..Axis::new("") };
            let range = range_of([value].into_iter(), &axis, [MARGIN; 2]).unwrap();
            assert!(range.first < value && value < range.last);
        }
        assert_eq!(range_of([f64::NAN, -1.0].into_iter(), &Axis::log(""), [0.0; 2]), None);
    }
}
