//! Runs that differ in one key, as curves: medians and ranges over runs that differ in nothing but their seed.

use super::series::{CurveKeys, Curves, Series};
use crate::runs::record::{MissingKeys, RunRecord};
use crate::runs::values::{MedianRange, is_same, order, plain};
use lf_core::Refusal;
use serde_json::Value;
use std::cmp::Ordering;

/// x and y of one run, and its record.
type RunCurve<'a> = (Vec<f64>, Vec<f64>, &'a RunRecord);

/// Runs of one series.
struct Group<'a> {
    /// Value of the panel's key.
    panel: Value,
    /// Index of the key of y.
    y: usize,
    /// Values of the keys that divide the series.
    by: Vec<Value>,
    /// Whether x and y are lists.
    is_list: bool,
    curves: Vec<RunCurve<'a>>,
}

/// The series of `records`. Refuses records without a run that has all keys, and lists that do not agree.
pub fn curves(records: &[RunRecord], keys: &CurveKeys) -> Result<Curves, Refusal> {
    let mut missing = MissingKeys::default();
    let mut groups: Vec<Group> = Vec::new();
    for record in records {
        add(record, keys, &mut groups, &mut missing)?;
    }
    if groups.is_empty() {
        return Err(missing.refusal(records));
    }
    let by_values = |a: &[Value], b: &[Value]| a.iter().zip(b).map(|(a, b)| order(a, b)).find(|order| order.is_ne());
    groups.sort_by(|a, b| {
        let by = by_values(&a.by, &b.by).unwrap_or(Ordering::Equal);
        order(&a.panel, &b.panel).then(a.y.cmp(&b.y)).then(by)
    });
    let series = groups.into_iter().map(|group| group.series(keys)).collect::<Result<Vec<Series>, Refusal>>()?;
    Ok(Curves { keys: keys.clone(), runs: records.len(), series, missing })
}

/// Adds a run to the group of each of its values.
fn add<'a>(
    record: &'a RunRecord,
    keys: &CurveKeys,
    groups: &mut Vec<Group<'a>>,
    missing: &mut MissingKeys,
) -> Result<(), Refusal> {
    let Some(x) = numbers(record, &keys.x) else {
        missing.count(&keys.x);
        return Ok(());
    };
    if let Some(key) = keys.panel.iter().chain(&keys.by).find(|key| record.get(key).is_none()) {
        missing.count(key);
        return Ok(());
    }
    let panel = keys.panel.as_ref().and_then(|key| record.get(key)).cloned().unwrap_or_default();
    let by: Vec<Value> = keys.by.iter().filter_map(|key| record.get(key)).cloned().collect();
    for (n, key) in keys.y.iter().enumerate() {
        let Some(y) = numbers(record, key) else {
            missing.count(key);
            continue;
        };
        let (x, y, is_list) = same_length(x.clone(), y, record, [&keys.x, key])?;
        let is_of = |group: &&mut Group| {
            group.y == n && is_same(&group.panel, &panel) && group.by.iter().zip(&by).all(|(a, b)| is_same(a, b))
        };
        match groups.iter_mut().find(is_of) {
            Some(group) if group.is_list != is_list => {
                let [here, others] = if is_list { ["a list", "numbers"] } else { ["a number", "lists"] };
                let found =
                    format!("{} has {here} at {key}, and other runs of its series have {others}", record.source);
                return Err(Refusal::new(found, "wanted only lists or only numbers"));
            }
            Some(group) => group.curves.push((x, y, record)),
            None => {
                let curves = vec![(x, y, record)];
                groups.push(Group { panel: panel.clone(), y: n, by: by.clone(), is_list, curves });
            }
        }
    }
    Ok(())
}

/// The numbers of a key, and whether they are a list. A single number becomes a list of one.
fn numbers(record: &RunRecord, key: &str) -> Option<(Vec<f64>, bool)> {
    let one = record.number(key).map(|number| (vec![number], false));
    one.or_else(|| Some((record.list(key)?, true)))
}

/// x and y with one length, and whether they are lists. Edges of bins become their centres.
fn same_length(
    (mut x, x_is_list): (Vec<f64>, bool),
    (y, y_is_list): (Vec<f64>, bool),
    record: &RunRecord,
    keys: [&str; 2],
) -> Result<(Vec<f64>, Vec<f64>, bool), Refusal> {
    if x_is_list && y_is_list && x.len() == y.len() + 1 {
        x = x.windows(2).map(|edges| 0.5 * (edges[0] + edges[1])).collect();
    }
    if x_is_list != y_is_list || x.len() != y.len() {
        let kind = |is_list, count| if is_list { format!("{count} numbers") } else { "one number".into() };
        let [x, y] = [kind(x_is_list, x.len()), kind(y_is_list, y.len())];
        let found = format!("{}: {x} at {} and {y} at {}", record.source, keys[0], keys[1]);
        return Err(Refusal::new(found, "wanted a number at both, or lists of one length"));
    }
    Ok((x, y, x_is_list))
}

impl Group<'_> {
    fn series(self, keys: &CurveKeys) -> Result<Series, Refusal> {
        let y = keys.y[self.y].clone();
        let values = keys.by.iter().zip(&self.by).map(|(key, value)| label(key, value));
        let y_name = (keys.y.len() > 1 || keys.by.is_empty()).then(|| y.clone());
        let name = y_name.into_iter().chain(values).collect::<Vec<_>>().join(", ");
        let panel = keys.panel.as_ref().map(|key| label(key, &self.panel));
        let places = if self.is_list { self.bins(&keys.x)? } else { self.points() };
        let (x, ranges): (Vec<f64>, Vec<MedianRange>) =
            places.into_iter().map(|(x, values)| (x, MedianRange::of(values))).unzip();
        Ok(Series {
            name,
            panel,
            y,
            x,
            median: ranges.iter().map(|range| range.median).collect(),
            low: ranges.iter().map(|range| range.low).collect(),
            high: ranges.iter().map(|range| range.high).collect(),
            runs: ranges.iter().map(|range| range.runs).collect(),
        })
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
        let differs = |(x, _, _): &&RunCurve| x.len() != first.len() || !x.iter().zip(first).all(|(a, b)| agree(a, b));
        if let Some((_, _, other)) = self.curves.iter().find(differs) {
            let found = format!("other bins at {key} in {} than in {}", other.source, record.source);
            return Err(Refusal::new(found, "wanted the same in all runs of a series"));
        }
        let values = |n: usize| self.curves.iter().map(move |(_, y, _)| y[n]).collect();
        Ok(first.iter().enumerate().map(|(n, x)| (*x, values(n))).collect())
    }
}

/// The name of a value: a text alone, a number with its key.
fn label(key: &str, value: &Value) -> String {
    let key = key.strip_prefix("set.").unwrap_or(key);
    if value.is_string() { plain(value) } else { format!("{key} = {}", plain(value)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runs::record::read_records;

    fn keys(x: &str, y: &[&str], by: &[&str]) -> CurveKeys {
        let owned = |names: &[&str]| names.iter().map(|key| (*key).to_string()).collect();
        CurveKeys { x: x.into(), y: owned(y), by: owned(by), panel: None }
    }

    #[test]
    fn seeds_become_a_median_and_a_spread() {
        let text = r#"{"n": 10, "set.k": 100, "e": 3} {"n": 10, "set.k": 100, "e": 5} {"n": 10, "set.k": 100, "e": 10}
            {"n": 2, "set.k": 100, "e": 7} {"n": 2, "set.k": 20, "e": 1} {"set.k": 20, "e": 1} {"n": 3, "set.k": 20, "e": null}"#;
        let curves = curves(&read_records(text, "runs").unwrap(), &keys("n", &["e"], &["set.k"])).unwrap();
        assert_eq!(curves.series.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["k = 20", "k = 100"]);
        let series = &curves.series[1];
        assert_eq!((&series.x[..], &series.median[..]), (&[2.0, 10.0][..], &[7.0, 5.0][..]));
        assert_eq!(
            (&series.low[..], &series.high[..], &series.runs[..]),
            (&[7.0, 3.0][..], &[7.0, 10.0][..], &[1, 3][..])
        );
        let warning = curves.missing.warning(curves.runs).unwrap();
        assert_eq!(warning, "1 of 7 runs left out, without n; 1 of 7 runs left out, without e");
    }

    #[test]
    fn lists_are_compared_bin_by_bin_and_edges_become_centres() {
        let text = r#"{"e": [0, 2, 4], "p": [1, 5]} {"e": [0, 2, 4], "p": [3, null]}"#;
        let found = curves(&read_records(text, "runs").unwrap(), &keys("e", &["p"], &[])).unwrap();
        let series = &found.series[0];
        assert_eq!((series.name.as_str(), &series.x[..], &series.median[..]), ("p", &[1.0, 3.0][..], &[2.0, 5.0][..]));
        assert_eq!(series.runs, [2, 1]);
        for (text, wanted) in [
            (r#"{"e": [0, 2], "p": [1, 5]} {"e": [0, 3], "p": [1, 5]}"#, "other bins at e in runs, object 2"),
            (r#"{"e": [0, 2], "p": [1]} {"e": 2, "p": 3}"#, "runs, object 2 has a number at p"),
            (r#"{"e": [0, 2], "p": [1, 2, 3]}"#, "2 numbers at e and 3 numbers at p"),
            (r#"{"e": 0, "q": [1, 2, 3]}"#, "their keys are e, q"),
        ] {
            let refusal = curves(&read_records(text, "runs").unwrap(), &keys("e", &["p"], &[])).unwrap_err();
            assert!(refusal.found.contains(wanted), "{refusal}");
        }
    }
}
