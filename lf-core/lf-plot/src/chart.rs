//! The parts of a chart: panels, axes and marks, and which of them cannot be drawn.

use lf_core::Refusal;

/// A picture of one or more panels.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Subject of the picture.
    pub title: String,
    /// Lines under the title.
    pub notes: Vec<String>,
    /// Number of panels beside each other.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// Two axes and the marks between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Subject of the panel; may be empty.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Whether one unit of x is drawn as long as one unit of y. It needs linear axes. A panel whose sides differ by
    /// more than a factor of six is stretched to that factor, and a note under the title says so.
    pub is_to_scale: bool,
    /// The marks; a later one covers earlier ones of its kind.
    pub marks: Vec<Mark>,
}

/// An axis of a panel, or of the colours of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub name: String,
    /// Whether it is logarithmic. Values at or below zero are then left out, and a note under the title counts them.
    pub is_log: bool,
    /// First and last value; the first may be the greater one. With `None` the range is that of the data.
    pub range: Option<[f64; 2]>,
}

/// The stroke of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Without gaps.
    Solid,
    /// With gaps.
    Dashed,
}

/// The place of a reference.
#[derive(Debug, Clone, PartialEq)]
pub enum Place {
    /// A vertical line at x.
    Vertical(f64),
    /// A horizontal line at y.
    Horizontal(f64),
    /// A line through points. It does not widen an axis that has other data.
    Curve(Vec<[f64; 2]>),
}

/// Something drawn in a panel. A mark with a name has an entry in the key. Lines and steps of one name share
/// colour, marker and entry. If a chart has at most seven such names, a name has the same look in all panels.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// Points joined in order; a point that is not finite leaves a gap. A few points are marked where the panel has
    /// several series.
    Line {
        /// Name in the key; may be empty.
        name: String,
        /// Points (x, y).
        points: Vec<[f64; 2]>,
        /// Stroke.
        style: Style,
    },
    /// The outline of a histogram; its vertical axis includes zero.
    Steps {
        /// Name in the key; may be empty.
        name: String,
        /// Edges of the bins: one more than there are values.
        edges: Vec<f64>,
        /// Height of each bin.
        values: Vec<f64>,
    },
    /// A value to compare with, dashed and grey. References of the same name share their dashes and their entry in the
    /// key.
    Reference {
        /// Name in the key; may be empty.
        name: String,
        /// Its place.
        place: Place,
    },
    /// A pale shade over an interval of x.
    Region {
        /// Name in the key; may be empty.
        name: String,
        /// First and last x.
        x: [f64; 2],
    },
    /// Vectors.
    Arrows(Arrows),
    /// Values over the plane as colours, with a colour bar. A cell whose value is not finite is grey. A scale whose
    /// range is given and symmetric about 0 runs from blue over white to red. If there are too many cells for a
    /// picture, means of blocks are drawn, and a note under the title says so.
    Map {
        /// Values row by row, x fastest; the first row stands at the first y.
        values: Vec<f64>,
        /// Number of cells along x and y.
        cells: [usize; 2],
        /// Outer edges of the first and the last column.
        x: [f64; 2],
        /// Outer edges of the first and the last row.
        y: [f64; 2],
        /// Name and range of the values.
        scale: Axis,
    },
}

/// Vectors, drawn as arrows centred on their points; a vector that is not finite is left out. They need linear axes.
///
/// A usual arrow is 0.62 of the distance between arrows long, at most 80 px. Longer arrows are cut to 1.6 times that,
/// so that no two of one grid meet, and a note under the title counts them. Arrows keep their direction when they are
/// cut, and in a stretched panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrows {
    /// Name in the key. If it is empty, the key shows an arrow of a round length with its value and unit.
    pub name: String,
    /// Unit of the vectors.
    pub unit: String,
    /// Length of a usual vector. If it is 0, the arrows are dots.
    pub usual: f64,
    /// Distances between the arrows along x and y, in units of the axes.
    pub spacing: [f64; 2],
    /// Drawn as outlines instead of in ink.
    pub is_hollow: bool,
    /// Points (x, y).
    pub points: Vec<[f64; 2]>,
    /// Components along x and y of the axes.
    pub vectors: Vec<[f64; 2]>,
}

impl Axis {
    /// A linear axis with the range of the data.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), is_log: false, range: None }
    }

    /// A logarithmic axis with the range of the data.
    pub fn log(name: impl Into<String>) -> Self {
        Self { is_log: true, ..Self::new(name) }
    }

    /// The axis from `first` to `last`.
    pub fn over(self, range: [f64; 2]) -> Self {
        Self { range: Some(range), ..self }
    }

    /// A linear axis from 0 to `most`; with the range of the data if `most` is not above 0.
    pub fn from_zero(name: impl Into<String>, most: f64) -> Self {
        Self { range: (most > 0.0).then_some([0.0, most]), ..Self::new(name) }
    }

    /// A linear axis from `-limit` to `limit`; with the range of the data if `limit` is not above 0.
    pub fn symmetric(name: impl Into<String>, limit: f64) -> Self {
        Self { range: (limit > 0.0).then_some([-limit, limit]), ..Self::new(name) }
    }

    /// Whether a value has a place on the axis.
    pub(super) fn holds(&self, value: f64) -> bool {
        value.is_finite() && (!self.is_log || value > 0.0)
    }
}

impl Panel {
    /// A panel without marks.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { title: title.into(), x, y, is_to_scale: false, marks: Vec::new() }
    }
}

impl Mark {
    /// A solid line.
    pub fn line(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self::Line { name: name.into(), points, style: Style::Solid }
    }

    /// A dashed line.
    pub fn dashed(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self::Line { name: name.into(), points, style: Style::Dashed }
    }

    /// The outline of a histogram.
    pub fn steps(name: impl Into<String>, edges: Vec<f64>, values: Vec<f64>) -> Self {
        Self::Steps { name: name.into(), edges, values }
    }

    /// A value to compare with.
    pub fn reference(name: impl Into<String>, place: Place) -> Self {
        Self::Reference { name: name.into(), place }
    }

    pub(super) fn name(&self) -> &str {
        match self {
            Self::Line { name, .. }
            | Self::Steps { name, .. }
            | Self::Reference { name, .. }
            | Self::Region { name, .. }
            | Self::Arrows(Arrows { name, .. }) => name,
            Self::Map { .. } => "",
        }
    }

    /// Whether it has a colour of its own.
    pub(super) fn is_series(&self) -> bool {
        matches!(self, Self::Line { .. } | Self::Steps { .. })
    }
}

/// Refuses lists of different lengths, and ranges that are empty or off their axis.
pub(super) fn check(chart: &Chart) -> Result<(), Refusal> {
    for panel in &chart.panels {
        check_axis(&panel.x)?;
        check_axis(&panel.y)?;
        panel.marks.iter().try_for_each(check_mark)?;
    }
    Ok(())
}

fn check_axis(axis: &Axis) -> Result<(), Refusal> {
    match axis.range {
        Some([first, last]) if !(axis.holds(first) && axis.holds(last) && first != last) => {
            let kind = if axis.is_log { "two different numbers above 0" } else { "two different numbers" };
            Err(Refusal::new(format!("axis '{}' from {first} to {last}", axis.name), format!("wanted {kind}")))
        }
        _ => Ok(()),
    }
}

fn check_mark(mark: &Mark) -> Result<(), Refusal> {
    let agree = |found: usize, items: &str, wanted: usize| match found == wanted {
        true => Ok(()),
        false => Err(Refusal::new(format!("'{}' has {found} {items}", mark.name()), format!("wanted {wanted}"))),
    };
    match mark {
        Mark::Steps { edges, values, .. } => {
            agree(edges.len(), "edges", if values.is_empty() { edges.len() } else { values.len() + 1 })
        }
        Mark::Map { values, cells, x, y, scale, .. } => {
            check_axis(scale)?;
            agree(values.len(), "cells", cells[0] * cells[1])?;
            if [x, y].into_iter().flatten().all(|edge| edge.is_finite()) && x[0] != x[1] && y[0] != y[1] {
                return Ok(());
            }
            Err(Refusal::new(format!("a map over x {x:?} and y {y:?}"), "wanted edges that differ"))
        }
        Mark::Arrows(arrows) => agree(arrows.vectors.len(), "vectors", arrows.points.len()),
        Mark::Line { .. } | Mark::Reference { .. } | Mark::Region { .. } => Ok(()),
    }
}
