//! The picture of curves over runs.

use super::series::{Curves, Series};
use lf_core::plot::{Axis, Chart, Mark, Panel, Style};

/// Most points of a curve that each get a marker.
const MOST_MARKED: usize = 30;

/// Axes and words of a chart.
#[derive(Debug, Clone)]
pub struct ChartOptions {
    /// Title.
    pub title: String,
    /// Axis to the right. Without a name it takes the key of x.
    pub x: Axis,
    /// Axis upwards. Without a name it takes the keys of y.
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
