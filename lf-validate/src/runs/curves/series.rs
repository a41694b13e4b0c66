//! Curves over runs: as they are printed, and as they are drawn.

use crate::runs::record::MissingKeys;
use lf_plot::{Axis, Chart, Mark, Panel, Style};
use serde::{Serialize, Serializer};

/// The keys that make the curves.
#[derive(Debug, Clone, Default, Serialize)]
pub struct CurveKeys {
    /// Key of x: a number, or a list of them.
    pub x: String,
    /// Keys of y: numbers or lists. Each gives its own series.
    pub y: Vec<String>,
    /// Keys whose values divide the runs into series.
    pub by: Vec<String>,
    /// Key whose values divide the series into panels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub panel: Option<String>,
}

/// All series of the runs.
#[derive(Debug, Clone, Serialize)]
pub struct Curves {
    #[serde(flatten)]
    pub(super) keys: CurveKeys,
    /// Runs that were read and selected.
    pub runs: usize,
    /// Sorted by panel, y and the values of `by`; numbers by size.
    #[serde(serialize_with = "by_name")]
    pub series: Vec<Series>,
    /// Runs that lack a key.
    #[serde(skip)]
    pub missing: MissingKeys,
}

/// One curve. All lists have the same length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// Name in its panel.
    #[serde(skip)]
    pub name: String,
    /// Name of its panel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub panel: Option<String>,
    /// Key of its values.
    pub y: String,
    /// Places: sorted, or in the order of the runs' lists. Bins given by their edges have their centres here.
    pub x: Vec<f64>,
    pub median: Vec<f64>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
    /// Runs with a number at this place.
    pub runs: Vec<usize>,
}

/// The series as an object with their names as keys.
fn by_name<S: Serializer>(series: &[Series], serializer: S) -> Result<S::Ok, S::Error> {
    let name = |series: &Series| match &series.panel {
        Some(panel) => format!("{panel}: {}", series.name),
        None => series.name.clone(),
    };
    serializer.collect_map(series.iter().map(|series| (name(series), series)))
}

/// Most points of a curve that each get a marker.
const MOST_MARKED: usize = 30;

/// Axes and words of a chart. An axis without a name takes its keys.
#[derive(Debug, Clone)]
pub struct ChartOptions {
    /// Title.
    pub title: String,
    /// Axis to the right.
    pub x: Axis,
    /// Axis upwards.
    pub y: Axis,
    /// References to draw in every panel.
    pub references: Vec<Mark>,
}

impl Curves {
    /// The curves with the area from least to greatest value, and one panel for each value of the panel's key.
    pub fn chart(&self, options: &ChartOptions) -> Chart {
        let names = [self.keys.x.clone(), self.keys.y.join(", ")];
        let [x, y] = [(&options.x, &names[0]), (&options.y, &names[1])].map(|(axis, key)| {
            let name = if axis.name.is_empty() { key.clone() } else { axis.name.clone() };
            Axis { name, ..axis.clone() }
        });
        let panels = self.series.chunk_by(|one, other| one.panel == other.panel).map(|series| {
            let title = series[0].panel.clone().unwrap_or_default();
            let marks = options.references.iter().cloned().chain(series.iter().map(Series::mark)).collect();
            Panel { marks, ..Panel::new(title, x.clone(), y.clone()) }
        });
        let panels: Vec<Panel> = panels.collect();
        let most = self.series.iter().flat_map(|series| &series.runs).copied().max().unwrap_or(0);
        let note = format!("line: median of up to {most} runs; area: least to greatest");
        let columns = match panels.len() {
            4 => 2,
            count => count.min(3),
        };
        Chart { title: options.title.clone(), notes: if most > 1 { vec![note] } else { Vec::new() }, columns, panels }
    }
}

impl Series {
    fn mark(&self) -> Mark {
        let has_spread = self.runs.iter().any(|runs| *runs > 1);
        let spread = || self.low.iter().zip(&self.high).map(|(low, high)| [*low, *high]).collect();
        Mark::Line {
            name: self.name.clone(),
            points: self.x.iter().zip(&self.median).map(|(x, y)| [*x, *y]).collect(),
            spread: has_spread.then(spread),
            style: Style::Solid,
            with_points: self.x.len() <= MOST_MARKED,
        }
    }
}
