//! The warnings and failures of all logs.

use super::html::escape;
use super::source::Source;
use std::collections::BTreeMap;

/// Further lines are counted and not shown.
const MOST_LINES: usize = 30;

/// Lines of the logs that warn or report a failure, each with the logs that have it.
pub(super) fn lines(source: &dyn Source, logs: &[String]) -> Vec<(String, Vec<String>)> {
    let mut found = BTreeMap::<String, Vec<String>>::new();
    let mut order = Vec::new();
    for log in logs.iter().filter(|log| !["log/done.txt", "log/missing.txt"].contains(&log.as_str())) {
        for line in source.text(log).unwrap_or_default().lines().filter(|line| is_warning(line)) {
            let files = found.entry(line.to_owned()).or_insert_with(|| {
                order.push(line.to_owned());
                Vec::new()
            });
            files.push(log.trim_start_matches("log/").trim_end_matches(".txt").to_owned());
        }
    }
    order.into_iter().map(|line| (line.clone(), found.remove(&line).unwrap_or_default())).collect()
}

/// Whether a line of a tool warns, or is its refusal: `tool: file: found; wanted ...`.
fn is_warning(line: &str) -> bool {
    line.contains(": warning: ") || (line.starts_with("lf-") && line.contains("; wanted "))
}

/// The box at the top of the page. `own` are lines about this page: files that could not be read. Without logs it is
/// not known whether a stage warned.
pub(super) fn list(lines: &[(String, Vec<String>)], own: &[String], has_logs: bool) -> String {
    if lines.is_empty() && own.is_empty() {
        let text = if has_logs { "No stage warned." } else { "No logs: whether a stage warned is not known." };
        return format!("<p class=\"soft\">{text}</p>\n");
    }
    let count = lines.len() + own.len();
    let heading = if count == 1 { "1 warning".to_owned() } else { format!("{count} warnings") };
    let mut html = format!("<div class=\"warnings\" id=\"warnings\"><strong>{heading}</strong>\n<ul>\n");
    for line in own {
        html += &format!("<li>{}</li>\n", escape(line));
    }
    for (line, files) in lines.iter().take(MOST_LINES) {
        let line = line.replacen(": warning: ", ": ", 1);
        let more = if files.len() > 3 { format!(" and {} more", files.len() - 3) } else { String::new() };
        let files = files.iter().take(3).cloned().collect::<Vec<_>>().join(", ");
        html += &format!("<li>{} <span class=\"soft\">({}{more})</span></li>\n", escape(&line), escape(&files));
    }
    if lines.len() > MOST_LINES {
        html += &format!("<li>and {} more in the folder of logs</li>\n", lines.len() - MOST_LINES);
    }
    html + "</ul></div>\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::{Error, Field, Result, Volume};
    use ndarray::Array2;
    use std::collections::BTreeSet;

    /// Logs by their names; nothing else.
    struct Logs(Vec<(&'static str, String)>);

    impl Source for Logs {
        fn names(&self) -> &BTreeSet<String> {
            unreachable!("names are given")
        }
        fn text(&self, name: &str) -> Result<String> {
            let log = self.0.iter().find(|(known, _)| *known == name);
            log.map(|(_, text)| text.clone()).ok_or_else(|| Error::new(name, "no such file", "wanted a log"))
        }
        fn field(&self, _: &str) -> Result<Field> {
            unreachable!("a log")
        }
        fn volume(&self, _: &str) -> Result<Volume> {
            unreachable!("a log")
        }
        fn allow(&self, _: f64, _: &str, _: &str) -> Result<()> {
            unreachable!("a log")
        }
        fn image(&self, _: &str) -> Result<Array2<f32>> {
            unreachable!("a log")
        }
    }

    #[test]
    fn equal_lines_are_shown_once_with_their_logs() {
        let warning = "lf-mart: warning: <dark>";
        let logs = Logs(vec![
            ("log/a.txt", format!("lf-mart: kept 5\n{warning}\n")),
            ("log/b.txt", format!("{warning}\nlf-mart: a.lfv: empty; wanted a .lfv file\n")),
            ("log/done.txt", warning.to_owned()),
        ]);
        let names: Vec<String> = logs.0.iter().map(|(name, _)| (*name).to_owned()).collect();
        let found = lines(&logs, &names);
        assert_eq!(found[0], (warning.to_owned(), vec!["a".to_owned(), "b".to_owned()]));
        assert_eq!(found.len(), 2);
        let html = list(&found, &[], true);
        assert!(html.contains("2 warnings") && html.contains("&lt;dark&gt;") && html.contains("(a, b)"), "{html}");
        assert!(list(&[], &[], true).contains("No stage warned") && list(&[], &[], false).contains("not known"));
    }
}
