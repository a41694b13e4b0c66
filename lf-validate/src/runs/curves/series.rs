//! Runs that differ in one thing, as curves: medians and spreads over runs that differ in nothing but their seed.

use crate::runs::record::{Middle, Missing, Record, Refusal, order, plain, same};
use lf_core::plot::{Axis, Chart, Mark, Panel, Style};
use serde::{Serialize, Serializer};
use serde_json::Value;
use std::cmp::Ordering;

/// Most points of a curve that are each marked in a chart.
const MOST_MARKED: usize = 30;

/// Which keys make the curves.
#[derive(Debug, Clone, Default)]
pub struct Ask {
    /// Key along the axis: a number, or a list of them.
    pub x: String,
    /// Keys of the values; each gives its own series.
    pub y: Vec<String>,
    /// Keys whose values part the runs into series.
    pub by: Vec<String>,
    /// Key whose values part the series into panels.
    pub panel: Option<String>,
}

/// Series of runs.
#[derive(Debug, Clone, Serialize)]
pub struct Curves {
    /// Key of x.
    pub x: String,
    /// Keys of y.
    pub y: Vec<String>,
    /// Keys that part the series.
    pub by: Vec<String>,
    /// Key that parts the panels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub panel: Option<String>,
    /// Runs that were read and asked for.
    pub runs: usize,
    /// By panel, y and the values of `by`, numbers by size.
    #[serde(serialize_with = "by_name")]
    pub series: Vec<Series>,
    /// Runs that lack a key.
    #[serde(skip)]
    pub missing: Missing,
}

/// One curve; lists of one length.
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
    /// Places, rising, or as the runs list them; the centres of bins that were given by their edges.
    pub x: Vec<f64>,
    /// Median over the runs.
    pub median: Vec<f64>,
    /// Least.
    pub low: Vec<f64>,
    /// Greatest.
    pub high: Vec<f64>,
    /// Runs with a number there.
    pub runs: Vec<usize>,
}

/// Axes and words of a chart.
#[derive(Debug, Clone)]
pub struct ChartOptions {
    /// What it shows.
    pub title: String,
    /// The axes; an empty name is that of the keys.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// Drawn in every panel.
    pub references: Vec<Mark>,
}

/// The x and y of one run, and where it is from.
type Curve<'a> = (Vec<f64>, Vec<f64>, &'a Record);

/// Runs of one series.
struct Group<'a> {
    panel: Value,
    y: usize,
    by: Vec<Value>,
    is_list: bool,
    curves: Vec<Curve<'a>>,
}

/// The series of `records`.
///
/// # Errors
/// What was found and what was wanted: no run with every key, with the keys there are; lists that do not agree.
pub fn curves(records: &[Record], ask: &Ask) -> Result<Curves, Refusal> {
    let mut missing = Missing::default();
    let mut groups: Vec<Group> = Vec::new();
    for record in records {
        let parts = ask.panel.iter().chain(&ask.by);
        let Some(x) = numbers(record, &ask.x) else {
            missing.count(&ask.x);
            continue;
        };
        if let Some(lacks) = parts.clone().find(|key| record.get(key).is_none()) {
            missing.count(lacks);
            continue;
        }
        let panel = ask.panel.as_ref().and_then(|key| record.get(key)).cloned().unwrap_or_default();
        let by: Vec<Value> = ask.by.iter().filter_map(|key| record.get(key)).cloned().collect();
        for (n, key) in ask.y.iter().enumerate() {
            let Some(y) = numbers(record, key) else {
                missing.count(key);
                continue;
            };
            let (x, y, is_list) = together(x.clone(), y, record, [&ask.x, key])?;
            let alike = |group: &&mut Group| {
                group.y == n && same(&group.panel, &panel) && group.by.iter().zip(&by).all(|(a, b)| same(a, b))
            };
            match groups.iter_mut().find(alike) {
                Some(group) if group.is_list != is_list => {
                    let found = format!("{} has lists at {key} or numbers, other runs of its series not", record.place);
                    return Err((found, "wanted lists or numbers".into()));
                }
                Some(group) => group.curves.push((x, y, record)),
                None => {
                    let curves = vec![(x, y, record)];
                    groups.push(Group { panel: panel.clone(), y: n, by: by.clone(), is_list, curves });
                }
            }
        }
    }
    if groups.is_empty() {
        return Err(missing.refusal(records));
    }
    let values = |a: &[Value], b: &[Value]| a.iter().zip(b).map(|(a, b)| order(a, b)).find(|order| order.is_ne());
    groups.sort_by(|a, b| {
        let by = values(&a.by, &b.by).unwrap_or(Ordering::Equal);
        order(&a.panel, &b.panel).then(a.y.cmp(&b.y)).then(by)
    });
    let series = groups.into_iter().map(|group| group.series(ask)).collect::<Result<Vec<Series>, Refusal>>()?;
    let Ask { x, y, by, panel } = ask.clone();
    Ok(Curves { x, y, by, panel, runs: records.len(), series, missing })
}

/// A list, or one number as a list of one; whether it was a list.
fn numbers(record: &Record, key: &str) -> Option<(Vec<f64>, bool)> {
    let one = record.number(key).map(|number| (vec![number], false));
    one.or_else(|| Some((record.list(key)?, true)))
}

/// x and y of one length: edges of bins become their centres.
fn together(
    (mut x, x_is_list): (Vec<f64>, bool),
    (y, y_is_list): (Vec<f64>, bool),
    record: &Record,
    keys: [&str; 2],
) -> Result<(Vec<f64>, Vec<f64>, bool), Refusal> {
    if x_is_list && y_is_list && x.len() == y.len() + 1 {
        x = x.windows(2).map(|edges| 0.5 * (edges[0] + edges[1])).collect();
    }
    if x_is_list != y_is_list || x.len() != y.len() {
        let kind = |is_list, count| if is_list { format!("{count} numbers") } else { "one number".into() };
        let [x, y] = [kind(x_is_list, x.len()), kind(y_is_list, y.len())];
        let found = format!("{}: {x} at {} and {y} at {}", record.place, keys[0], keys[1]);
        return Err((found, "wanted a number at both, or lists of one length".into()));
    }
    Ok((x, y, x_is_list))
}

impl Group<'_> {
    fn series(self, ask: &Ask) -> Result<Series, Refusal> {
        let y = ask.y[self.y].clone();
        let parts = ask.by.iter().zip(&self.by).map(|(key, value)| label(key, value));
        let key = (ask.y.len() > 1 || ask.by.is_empty()).then(|| y.clone());
        let name = key.into_iter().chain(parts).collect::<Vec<_>>().join(", ");
        let panel = ask.panel.as_ref().map(|key| label(key, &self.panel));
        let places = if self.is_list { self.bins(&ask.x)? } else { self.points() };
        let mut series = Series {
            name,
            panel,
            y,
            x: Vec::new(),
            median: Vec::new(),
            low: Vec::new(),
            high: Vec::new(),
            runs: Vec::new(),
        };
        for (x, values) in places {
            let middle = Middle::of(values);
            series.x.push(x);
            series.median.push(middle.median);
            series.low.push(middle.low);
            series.high.push(middle.high);
            series.runs.push(middle.runs);
        }
        Ok(series)
    }

    /// Every x with the values of its runs.
    fn points(&self) -> Vec<(f64, Vec<f64>)> {
        let mut points: Vec<[f64; 2]> = self.curves.iter().map(|(x, y, _)| [x[0] + 0.0, y[0]]).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let equal = points.chunk_by(|a, b| a[0] == b[0]);
        equal.map(|points| (points[0][0], points.iter().map(|point| point[1]).collect())).collect()
    }

    /// Every bin with the values of its runs.
    fn bins(&self, key: &str) -> Result<Vec<(f64, Vec<f64>)>, Refusal> {
        let (first, _, record) = &self.curves[0];
        let agree = |a: &f64, b: &f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs()) || a.is_nan() && b.is_nan();
        let other = |(x, _, _): &&Curve| x.len() != first.len() || !x.iter().zip(first).all(|(a, b)| agree(a, b));
        if let Some((_, _, other)) = self.curves.iter().find(other) {
            let found = format!("other bins at {key} in {} than in {}", other.place, record.place);
            return Err((found, "wanted the same in all runs of a series".into()));
        }
        let values = |n: usize| self.curves.iter().map(move |(_, y, _)| y[n]).collect();
        Ok(first.iter().enumerate().map(|(n, x)| (*x, values(n))).collect())
    }
}

/// A text says what it is; a number needs its key.
fn label(key: &str, value: &Value) -> String {
    let key = key.strip_prefix("set.").unwrap_or(key);
    if value.is_string() { plain(value) } else { format!("{key} = {}", plain(value)) }
}

fn by_name<S: Serializer>(series: &[Series], serializer: S) -> Result<S::Ok, S::Error> {
    let name = |series: &Series| match &series.panel {
        Some(panel) => format!("{panel}: {}", series.name),
        None => series.name.clone(),
    };
    serializer.collect_map(series.iter().map(|series| (name(series), series)))
}

impl Curves {
    /// The curves with the area from least to greatest, a panel for each value of the panel's key.
    pub fn chart(&self, options: &ChartOptions) -> Chart {
        let names = [self.x.clone(), self.y.join(", ")];
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runs::record::records;

    fn ask(x: &str, y: &[&str], by: &[&str]) -> Ask {
        let owned = |keys: &[&str]| keys.iter().map(|key| (*key).to_string()).collect();
        Ask { x: x.into(), y: owned(y), by: owned(by), panel: None }
    }

    #[test]
    fn seeds_become_a_median_and_a_spread() {
        let text = r#"{"n": 10, "set.k": 100, "e": 3} {"n": 10, "set.k": 100, "e": 5} {"n": 10, "set.k": 100, "e": 10}
            {"n": 2, "set.k": 100, "e": 7} {"n": 2, "set.k": 20, "e": 1} {"set.k": 20, "e": 1} {"n": 3, "set.k": 20, "e": null}"#;
        let curves = curves(&records(text, "runs").unwrap(), &ask("n", &["e"], &["set.k"])).unwrap();
        assert_eq!(curves.series.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["k = 20", "k = 100"]);
        let series = &curves.series[1];
        assert_eq!((&series.x[..], &series.median[..]), (&[2.0, 10.0][..], &[7.0, 5.0][..]));
        assert_eq!(
            (&series.low[..], &series.high[..], &series.runs[..]),
            (&[7.0, 3.0][..], &[7.0, 10.0][..], &[1, 3][..])
        );
        let line = curves.missing.line(curves.runs).unwrap();
        assert_eq!(line, "1 of 7 runs left out for want of n; 1 of 7 runs left out for want of e");
    }

    #[test]
    fn lists_are_taken_bin_by_bin_and_edges_become_centres() {
        let text = r#"{"e": [0, 2, 4], "p": [1, 5]} {"e": [0, 2, 4], "p": [3, null]}"#;
        let found = curves(&records(text, "runs").unwrap(), &ask("e", &["p"], &[])).unwrap();
        let series = &found.series[0];
        assert_eq!((series.name.as_str(), &series.x[..], &series.median[..]), ("p", &[1.0, 3.0][..], &[2.0, 5.0][..]));
        assert_eq!(series.runs, [2, 1]);
        for (text, wanted) in [
            (r#"{"e": [0, 2], "p": [1, 5]} {"e": [0, 3], "p": [1, 5]}"#, "other bins at e in runs, object 2"),
            (r#"{"e": [0, 2], "p": [1]} {"e": 2, "p": 3}"#, "runs, object 2 has lists"),
            (r#"{"e": [0, 2], "p": [1, 2, 3]}"#, "2 numbers at e and 3 numbers at p"),
            (r#"{"e": 0, "q": [1, 2, 3]}"#, "their keys are e, q"),
        ] {
            let (found, _) = curves(&records(text, "runs").unwrap(), &ask("e", &["p"], &[])).unwrap_err();
            assert!(found.contains(wanted), "{found}");
        }
    }
}
