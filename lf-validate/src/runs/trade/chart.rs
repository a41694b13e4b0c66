//! Error against cost, and the effect of each factor.

use super::settings::{Factor, Setting, Trade};
use crate::runs::values::{order, plain};
use lf_plot::{Axis, Chart, Mark, Panel, Place, Style};
use serde_json::Value;

/// With more settings than this, only the base and the settings on the Pareto front are named.
const MOST_NAMED: usize = 16;

/// Texts and limits of a chart.
#[derive(Debug, Clone, Default)]
pub struct ChartOptions {
    /// The title.
    pub title: String,
    /// Name and unit of the cost; if empty, the key of the cost.
    pub cost_name: String,
    /// Name and unit of the error; if empty, the key of the error.
    pub error_name: String,
    /// Limit of the cost.
    pub max_cost: Option<f64>,
    /// Limit of the error.
    pub max_error: Option<f64>,
}

impl Trade {
    /// Error against cost for all settings, and a panel for each factor with its settings relative to the base.
    pub fn chart(&self, options: &ChartOptions) -> Chart {
        let panels: Vec<Panel> =
            [self.whole_panel(options)].into_iter().chain(self.factors.iter().map(|f| self.panel(f))).collect();
        let most = self.settings.iter().map(|setting| setting.cost.runs).max().unwrap_or(0);
        let mut notes = vec!["Pareto front: no other setting has at most this cost and this error".to_string()];
        if most > 1 {
            notes.push(format!("point: median of up to {most} runs; bar: least to greatest error"));
        }
        let columns = match panels.len() {
            count @ 1..=2 => count,
            4 => 2,
            _ => 3,
        };
        Chart { title: options.title.clone(), notes, columns, panels }
    }

    fn whole_panel(&self, options: &ChartOptions) -> Panel {
        let name = |name: &String, key: &String| if name.is_empty() { key.clone() } else { name.clone() };
        let x = Axis::log(name(&options.cost_name, &self.keys.cost));
        let y = Axis::log(name(&options.error_name, &self.keys.error));
        let base = self.base();
        let is_named = |n: usize| self.settings.len() <= MOST_NAMED || self.front.contains(&n) || Some(n) == base;
        let points = |name: &str, chosen: &[usize]| {
            let settings: Vec<(usize, &Setting)> = chosen.iter().map(|n| (*n, &self.settings[*n])).collect();
            let label = |(n, setting): &(usize, &Setting)| if is_named(*n) { setting.name.clone() } else { "".into() };
            let has_spread = settings.iter().any(|(_, setting)| setting.error.runs > 1);
            let spread = || settings.iter().map(|(_, setting)| [setting.error.low, setting.error.high]).collect();
            Mark::Points {
                name: name.into(),
                points: settings.iter().map(|(_, setting)| place(setting)).collect(),
                spread: has_spread.then(spread),
                labels: Some(settings.iter().map(label).collect()),
            }
        };
        let behind: Vec<usize> = (0..self.settings.len()).filter(|n| !self.front.contains(n)).collect();
        let front = self.front.iter().map(|n| place(&self.settings[*n])).collect();
        let mut marks = vec![joined("Pareto front", front), points("Pareto front", &self.front)];
        if !behind.is_empty() {
            marks.push(points("other settings", &behind));
        }
        marks.extend(base.map(|base| Mark::points("base", vec![place(&self.settings[base])])));
        let limits = [options.max_cost.map(Place::Vertical), options.max_error.map(Place::Horizontal)];
        marks.extend(limits.into_iter().flatten().map(|place| Mark::reference("limit", place)));
        Panel { marks, ..Panel::new("", x, y) }
    }

    fn panel(&self, factor: &Factor) -> Panel {
        let mut rows: Vec<(&Value, [f64; 2])> =
            factor.effects.iter().map(|effect| (&effect.value, [effect.cost_ratio, effect.error_ratio])).collect();
        let is_ordered = rows.iter().all(|(value, _)| value.is_number()) && factor.base.is_number();
        rows.push((&factor.base, [1.0; 2]));
        rows.sort_by(|a, b| order(a.0, b.0));
        let points: Vec<[f64; 2]> = rows.iter().map(|(_, point)| *point).collect();
        let labels = rows.iter().map(|(value, _)| plain(value)).collect();
        let mut marks: Vec<Mark> =
            [Place::Vertical(1.0), Place::Horizontal(1.0)].map(|place| Mark::reference("base", place)).to_vec();
        // Only numbers have an order that a line can follow.
        if is_ordered {
            marks.push(joined(&factor.key, points.clone()));
        }
        let [x, y] = ["cost", "error"].map(|what| Axis::log(format!("{what} / {what} of base")));
        let [x, y] = [x.over(about_one(&points, 0)), y.over(about_one(&points, 1))];
        marks.push(Mark::Points { name: factor.key.clone(), points, spread: None, labels: Some(labels) });
        Panel { marks, ..Panel::new("", x, y) }
    }
}

/// The range of the ratios with a margin, at least 0.8 to 1.25: a smaller range would show noise as an effect.
fn about_one(points: &[[f64; 2]], axis: usize) -> [f64; 2] {
    let ratios = points.iter().map(|point| point[axis]).filter(|ratio| ratio.is_finite() && *ratio > 0.0);
    ratios.fold([0.8, 1.25], |[low, high], ratio| [low.min(ratio / 1.15), high.max(ratio * 1.15)])
}

/// Median cost and median error of a setting.
fn place(setting: &Setting) -> [f64; 2] {
    [setting.cost.median, setting.error.median]
}

fn joined(name: &str, points: Vec<[f64; 2]>) -> Mark {
    Mark::Line { name: name.into(), points, spread: None, style: Style::Solid, with_points: true }
}
