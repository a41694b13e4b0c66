//! Values of runs: as people type, compare and read them; their median and range.

use lf_core::statistics::median;
use serde_json::Value;
use std::cmp::Ordering;

/// A word as a value: a number, `true`, `false`, or text.
pub fn parse_value(word: &str) -> Value {
    match word {
        "true" => Value::Bool(true),
        "false" => Value::Bool(false),
        _ => {
            let number = || word.parse::<f64>().ok().filter(|number| number.is_finite()).map(Value::from);
            word.parse::<i64>().ok().map(Value::from).or_else(number).unwrap_or_else(|| Value::from(word))
        }
    }
}

/// A value as text: without quotes, and `none` for null.
pub fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "none".into(),
        _ => value.to_string(),
    }
}

/// Whether two values are equal. 1 equals 1.0.
pub fn is_same(one: &Value, other: &Value) -> bool {
    order(one, other) == Ordering::Equal
}

/// Order of values: numbers by size, then booleans, then texts by alphabet, then lists and objects, then null.
pub fn order(one: &Value, other: &Value) -> Ordering {
    let rank = |value: &Value| match value {
        Value::Number(_) => 0,
        Value::Bool(_) => 1,
        Value::String(_) => 2,
        Value::Null => 4,
        _ => 3,
    };
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => {
            // Adding 0 makes -0 equal to 0.
            let [one, other] = [one, other].map(|number| number.as_f64().unwrap_or(f64::NAN) + 0.0);
            one.total_cmp(&other)
        }
        (Value::Bool(one), Value::Bool(other)) => one.cmp(other),
        (Value::String(one), Value::String(other)) => one.cmp(other),
        (Value::Array(_), Value::Array(_)) => one.to_string().cmp(&other.to_string()),
        _ => rank(one).cmp(&rank(other)),
    }
}

/// Median, least and greatest of the finite ones of some numbers. NaN without numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MedianRange {
    pub median: f64,
    pub low: f64,
    pub high: f64,
    /// Number of finite numbers: the runs that have one.
    pub runs: usize,
}

impl MedianRange {
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
        let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max]
            .map(|pick| values.iter().copied().reduce(pick).unwrap_or(f64::NAN));
        Self { low, high, runs: values.len(), median: median(&mut values) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn words_have_types() {
        for (word, value) in [
            ("60", json!(60)),
            ("-0.5", json!(-0.5)),
            ("1e3", json!(1000.0)),
            ("true", json!(true)),
            ("drt", json!("drt")),
            ("inf", json!("inf")),
            ("", json!("")),
        ] {
            assert_eq!(parse_value(word), value);
        }
    }

    #[test]
    fn values_are_in_order() {
        let mut values = vec![json!("b"), json!(10), json!(null), json!(2.5), json!(true), json!("a"), json!(-1)];
        values.sort_by(order);
        assert_eq!(json!(values), json!([-1, 2.5, 10, true, "a", "b", null]));
        assert!(is_same(&json!(1), &json!(1.0)) && !is_same(&json!("1"), &json!(1)));
    }

    #[test]
    fn only_finite_values_count() {
        assert_eq!(MedianRange::of([3.0, f64::NAN, 1.0]), MedianRange { median: 2.0, low: 1.0, high: 3.0, runs: 2 });
        assert!(MedianRange::of([]).low.is_nan());
    }
}
