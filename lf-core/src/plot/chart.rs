//! What a chart is made of.

use crate::Refusal;

/// A picture of one or more panels.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// What it shows.
    pub title: String,
    /// Lines under the title.
    pub notes: Vec<String>,
    /// Panels beside each other.
    pub columns: usize,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
}

/// Two axes and what stands between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// What it shows; may be empty.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// One unit of x is drawn as long as one of y. Linear axes only.
    pub is_to_scale: bool,
    /// What is drawn; later marks stand on earlier ones of the same kind.
    pub marks: Vec<Mark>,
}

/// An axis of a panel, or of the colours of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub name: String,
    /// Logarithmic: values at or below zero are left out, and a note under the title counts them.
    pub is_log: bool,
    /// First and last value; the first may be the greater one. None: from the data.
    pub range: Option<[f64; 2]>,
}

/// How a line is stroked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Without gaps.
    Solid,
    /// With gaps.
    Dashed,
}

/// Where a reference stands.
#[derive(Debug, Clone, PartialEq)]
pub enum Place {
    /// Upright, at x.
    Vertical(f64),
    /// Level, at y.
    Horizontal(f64),
    /// Through points. It does not widen an axis that has other data.
    Curve(Vec<[f64; 2]>),
}

/// Something drawn in a panel.
///
/// A mark with a name has a place in the panel's key. Lines, steps and points with one name have one colour, one marker and
/// one place in the key; with at most seven names in a chart, in all of its panels.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// Points joined in their order; a point that is not finite leaves a gap.
    Line {
        /// Name in the key; may be empty.
        name: String,
        /// Places (x, y).
        points: Vec<[f64; 2]>,
        /// Least and greatest y at each point, drawn as a translucent area.
        spread: Option<Vec<[f64; 2]>>,
        /// Stroke.
        style: Style,
        /// Marks every point. Else a few of them are, where a panel has several series, to tell them apart without colour.
        with_points: bool,
    },
    /// Outline of a histogram; its axis includes zero.
    Steps {
        /// Name in the key; may be empty.
        name: String,
        /// Edges of the bins, one more than values.
        edges: Vec<f64>,
        /// Height of each bin.
        values: Vec<f64>,
    },
    /// Points that are not joined.
    Points {
        /// Name in the key; may be empty.
        name: String,
        /// Places (x, y).
        points: Vec<[f64; 2]>,
        /// Least and greatest y at each point, drawn as a bar.
        spread: Option<Vec<[f64; 2]>>,
        /// A word beside each point. Words that find no room are left out, and a note under the title counts them.
        labels: Option<Vec<String>>,
    },
    /// Something to compare with, in dashed grey; those of one name have one dash and one place in the key.
    Reference {
        /// Name in the key; may be empty.
        name: String,
        /// Where it stands.
        place: Place,
    },
    /// A pale shade over a part of x.
    Region {
        /// Name in the key; may be empty.
        name: String,
        /// First and last x.
        x: [f64; 2],
    },
    /// Vectors, drawn from half before to half behind their places; of those that are not finite nothing is.
    Arrows {
        /// Places (x, y).
        points: Vec<[f64; 2]>,
        /// How far each reaches along x and y.
        vectors: Vec<[f64; 2]>,
    },
    /// Values over the plane as colours, with a bar that tells them. A value that is not finite is grey. A scale whose range
    /// is given and symmetric about 0 runs from blue over white to red.
    ///
    /// Cells beyond what a picture can hold are drawn as means of blocks, and a note under the title says so.
    Map {
        /// Row by row, x fastest; the first row stands at the first y.
        values: Vec<f64>,
        /// Cells along x and y.
        cells: [usize; 2],
        /// Outer edges of the first and the last column.
        x: [f64; 2],
        /// Outer edges of the first and the last row.
        y: [f64; 2],
        /// What the colours mean.
        scale: Axis,
    },
}

impl Axis {
    /// A linear axis that fits the data.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), is_log: false, range: None }
    }

    /// A logarithmic axis that fits the data.
    pub fn log(name: impl Into<String>) -> Self {
        Self { is_log: true, ..Self::new(name) }
    }

    /// The axis from `first` to `last`.
    pub fn over(self, range: [f64; 2]) -> Self {
        Self { range: Some(range), ..self }
    }

    /// Whether a value has a place on the axis.
    pub(super) fn holds(&self, value: f64) -> bool {
        value.is_finite() && (!self.is_log || value > 0.0)
    }
}

impl Panel {
    /// A panel with nothing drawn yet.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { title: title.into(), x, y, is_to_scale: false, marks: Vec::new() }
    }
}

impl Mark {
    /// A solid line without marked points.
    pub fn line(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self::Line { name: name.into(), points, spread: None, style: Style::Solid, with_points: false }
    }

    /// Points without spread and labels.
    pub fn points(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self::Points { name: name.into(), points, spread: None, labels: None }
    }

    /// A reference.
    pub fn reference(name: impl Into<String>, place: Place) -> Self {
        Self::Reference { name: name.into(), place }
    }

    /// The name in the key, empty for a map and for arrows.
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Line { name, .. }
            | Self::Steps { name, .. }
            | Self::Points { name, .. }
            | Self::Reference { name, .. }
            | Self::Region { name, .. } => name,
            Self::Arrows { .. } | Self::Map { .. } => "",
        }
    }

    /// Whether it is a series, which takes a colour.
    pub(super) fn is_series(&self) -> bool {
        matches!(self, Self::Line { .. } | Self::Steps { .. } | Self::Points { .. })
    }
}

impl Chart {
    /// Refuses lists that do not belong together and ranges that are none.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        for panel in &self.panels {
            for axis in [&panel.x, &panel.y] {
                axis.check()?;
            }
            panel.marks.iter().try_for_each(Mark::check)?;
        }
        Ok(())
    }
}

impl Axis {
    fn check(&self) -> Result<(), Refusal> {
        match self.range {
            Some([first, last]) if !(self.holds(first) && self.holds(last) && first != last) => {
                let kind = if self.is_log { "two different numbers above 0" } else { "two different numbers" };
                Err(Refusal::new(format!("axis '{}' from {first} to {last}", self.name), format!("wanted {kind}")))
            }
            _ => Ok(()),
        }
    }
}

impl Mark {
    fn check(&self) -> Result<(), Refusal> {
        let agree = |found: usize, what: &str, wanted: usize| {
            if found == wanted {
                return Ok(());
            }
            Err(Refusal::new(format!("'{}' has {found} {what}", self.name()), format!("wanted {wanted}")))
        };
        match self {
            Self::Line { points, spread, .. } => {
                agree(spread.as_ref().map_or(points.len(), Vec::len), "spreads", points.len())
            }
            Self::Points { points, spread, labels, .. } => {
                agree(spread.as_ref().map_or(points.len(), Vec::len), "spreads", points.len())?;
                agree(labels.as_ref().map_or(points.len(), Vec::len), "labels", points.len())
            }
            Self::Steps { edges, values, .. } => {
                agree(edges.len(), "edges", if values.is_empty() { edges.len() } else { values.len() + 1 })
            }
            Self::Map { values, cells, x, y, scale, .. } => {
                scale.check()?;
                agree(values.len(), "cells", cells[0] * cells[1])?;
                if [x, y].into_iter().flatten().all(|edge| edge.is_finite()) && x[0] != x[1] && y[0] != y[1] {
                    return Ok(());
                }
                Err(Refusal::new(format!("a map over x {x:?} and y {y:?}"), "wanted edges that differ"))
            }
            Self::Arrows { points, vectors } => agree(vectors.len(), "vectors", points.len()),
            Self::Reference { .. } | Self::Region { .. } => Ok(()),
        }
    }
}
