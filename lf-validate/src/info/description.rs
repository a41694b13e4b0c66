//! The description of a file: a title and labelled lines.

use lf_core::{History, history::Step};
use std::fmt;

/// Older steps of the history are counted only, so that a description fits a screen.
const MOST_STEPS: usize = 8;
/// A text is cut after this many characters: a hostile or broken header must not flood a terminal.
const MOST_CHARACTERS: usize = 400;

/// A title, then lines of a label and a text. Prints aligned, with control characters escaped.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// Kind of the file.
    pub title: String,
    /// Label and text. An empty label continues the line above.
    pub lines: Vec<(String, String)>,
}

impl Description {
    pub(super) fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), lines: Vec::new() }
    }

    pub(super) fn line(&mut self, label: impl Into<String>, text: impl Into<String>) {
        self.lines.push((label.into(), text.into()));
    }

    /// Adds the last steps of a history.
    pub(super) fn history(&mut self, history: &History) {
        let older = history.len().saturating_sub(MOST_STEPS);
        if history.is_empty() {
            self.line("history", "none");
        }
        if older > 0 {
            self.line("history", format!("{older} older steps"));
        }
        for (n, Step { tool, version, arguments }) in history.iter().enumerate().skip(older) {
            let label = if n == 0 { "history" } else { "" };
            self.line(label, format!("{tool} {version}: {}", arguments.join(" ")));
        }
    }
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(f, "{}", escaped(&self.title))?;
        let width = self.lines.iter().map(|(label, _)| escaped(label).chars().count()).max().unwrap_or(0);
        for (label, text) in &self.lines {
            writeln!(f, "  {:width$}  {}", escaped(label), escaped(text))?;
        }
        Ok(())
    }
}

/// A text without control characters, cut to [`MOST_CHARACTERS`].
fn escaped(text: &str) -> String {
    let mut shown = String::new();
    for (n, c) in text.chars().enumerate() {
        if n == MOST_CHARACTERS {
            shown.push_str(" ...");
            break;
        }
        if c.is_control() { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    shown
}

#[cfg(test)]
pub(super) fn assert_shows(text: &str, parts: &[&str]) {
    parts.iter().for_each(|part| assert!(text.contains(part), "{part} is not in\n{text}"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_align_and_control_characters_are_escaped() {
        let mut description = Description::new("a\u{1b}[31m thing");
        description.line("long label", "one");
        description.line("x", "two\nthree");
        description.line("y", "z".repeat(1000));
        let text = description.to_string();
        assert!(text.starts_with("a\\u{1b}[31m thing\n  long label  one\n  x           two\\nthree\n"));
        assert_eq!(text.lines().count(), 4);
        assert!(text.len() < 600);
    }

    #[test]
    fn a_long_history_keeps_its_end() {
        let step = |n: usize| Step { tool: format!("tool-{n}"), version: "1".into(), arguments: vec!["a".into()] };
        let mut description = Description::new("t");
        description.history(&(0..20).map(step).collect());
        assert_eq!(description.lines.len(), 9);
        assert_eq!(description.lines[0], ("history".into(), "12 older steps".into()));
        assert_eq!(description.lines[8], (String::new(), "tool-19 1: a".into()));
    }
}
