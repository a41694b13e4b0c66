//! A title and labelled lines.

use super::summary::Summary;
use lf_core::history::{History, Step};
use serde::Serialize;
use std::fmt;

/// Steps of history shown; what is older is counted, so that a sheet stays within a screen.
const STEPS: usize = 8;

/// Characters of a line shown: a hostile or mistaken header must not flood a terminal.
const WIDTH: usize = 400;

/// A description: a title, then lines of a label and what it is. Prints aligned, and with control characters escaped.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sheet {
    /// What it is.
    pub title: String,
    /// Label and text; an empty label continues the line above.
    pub lines: Vec<(String, String)>,
}

impl Sheet {
    pub(super) fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), lines: Vec::new() }
    }

    pub(super) fn line(&mut self, label: impl Into<String>, text: impl Into<String>) {
        self.lines.push((label.into(), text.into()));
    }

    pub(super) fn history(&mut self, history: &History) {
        let shown = history.len().saturating_sub(STEPS);
        if history.is_empty() {
            self.line("history", "none");
        }
        if shown > 0 {
            self.line("history", format!("{shown} older steps"));
        }
        for (n, Step { tool, version, arguments }) in history.iter().enumerate().skip(shown) {
            let label = if n == 0 { "history" } else { "" };
            self.line(label, format!("{tool} {version}: {}", arguments.join(" ")));
        }
    }
}

impl fmt::Display for Sheet {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(f, "{}", plain(&self.title))?;
        let width = self.lines.iter().map(|(label, _)| plain(label).chars().count()).max().unwrap_or(0);
        for (label, text) in &self.lines {
            writeln!(f, "  {:width$}  {}", plain(label), plain(text))?;
        }
        Ok(())
    }
}

fn plain(text: &str) -> String {
    let mut shown = String::new();
    for (n, c) in text.chars().enumerate() {
        if n == WIDTH {
            shown.push_str(" ...");
            break;
        }
        if c.is_control() { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    shown
}

/// A number to six figures, without trailing zeros.
pub(super) fn figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { value.to_string() };
    }
    let size = value.abs().log10().floor();
    if !(-5.0..9.0).contains(&size) {
        return format!("{value:.5e}");
    }
    let text = format!("{value:.*}", (5.0 - size).max(0.0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Numbers to six figures with `x` between.
pub(super) fn by(values: &[f64]) -> String {
    values.iter().map(|&value| figures(value)).collect::<Vec<_>>().join(" x ")
}

/// A whole number with its thousands set apart.
pub(super) fn whole(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (n, digit) in digits.chars().enumerate() {
        if n > 0 && (digits.len() - n).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// `part` of `whole` in per cent.
pub(super) fn share(part: usize, whole: usize) -> String {
    format!("{} %", figures(100.0 * part as f64 / whole.max(1) as f64))
}

/// Extremes, mean and sum in a line.
pub(super) fn range(summary: &Summary) -> String {
    if summary.count == summary.not_finite {
        return if summary.count == 0 { "no values".into() } else { "no finite value".into() };
    }
    let [min, max, mean, sum] = [summary.min, summary.max, summary.mean(), summary.sum].map(figures);
    let odd = if summary.not_finite > 0 { format!(", {} not finite", summary.not_finite) } else { String::new() };
    format!("min {min}, max {max}, mean {mean}, sum {sum}{odd}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_written_by_hand() {
        for (value, text) in [
            (0.0, "0"),
            (0.0055, "0.0055"),
            (1.0 / 3.0, "0.333333"),
            (-400.0, "-400"),
            (1234567.8, "1234568"),
            (1.5e-9, "1.50000e-9"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(figures(value), text);
        }
        assert_eq!(whole(14268800), "14 268 800");
        assert_eq!(whole(7), "7");
    }

    #[test]
    fn labels_align_and_control_characters_are_escaped() {
        let mut sheet = Sheet::new("a\u{1b}[31m thing");
        sheet.line("long label", "one");
        sheet.line("x", "two\nthree");
        sheet.line("y", "z".repeat(1000));
        let text = sheet.to_string();
        assert!(text.starts_with("a\\u{1b}[31m thing\n  long label  one\n  x           two\\nthree\n"));
        assert_eq!(text.lines().count(), 4);
        assert!(text.len() < 600);
    }

    #[test]
    fn a_long_history_keeps_its_end() {
        let step = |n: usize| Step { tool: format!("tool-{n}"), version: "1".into(), arguments: vec!["a".into()] };
        let mut sheet = Sheet::new("t");
        sheet.history(&(0..20).map(step).collect());
        assert_eq!(sheet.lines.len(), 9);
        assert_eq!(sheet.lines[0], ("history".into(), "12 older steps".into()));
        assert_eq!(sheet.lines[8], (String::new(), "tool-19 1: a".into()));
    }
}
