//! The warnings and failures of all logs.

use super::folder::name;
use super::html::escape;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Most different lines that are shown.
const MOST_LINES: usize = 30;

/// Lines of the logs that warn or tell of a failure, each with the logs that have it.
pub(super) fn lines(logs: &[PathBuf]) -> Vec<(String, Vec<String>)> {
    let mut found = BTreeMap::<String, Vec<String>>::new();
    let mut order = Vec::new();
    for log in logs.iter().filter(|log| !["done.txt", "missing.txt"].contains(&name(log).as_str())) {
        let text = std::fs::read(log).unwrap_or_default();
        for line in String::from_utf8_lossy(&text).lines().filter(|line| speaks_up(line)) {
            let files = found.entry(line.to_owned()).or_insert_with(|| {
                order.push(line.to_owned());
                Vec::new()
            });
            files.push(name(log).trim_end_matches(".txt").to_owned());
        }
    }
    order.into_iter().map(|line| (line.clone(), found.remove(&line).unwrap_or_default())).collect()
}

/// Whether a line of a tool warns, or is its refusal: `tool: file: found; wanted ...`.
fn speaks_up(line: &str) -> bool {
    line.contains(": warning: ") || (line.starts_with("lf-") && line.contains("; wanted "))
}

/// The box at the top of the page. `own` are lines about this page: files that could not be read.
pub(super) fn list(lines: &[(String, Vec<String>)], own: &[String]) -> String {
    if lines.is_empty() && own.is_empty() {
        return "<p class=\"soft\">No stage warned.</p>\n".into();
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

    #[test]
    fn equal_lines_are_told_once_with_their_logs() {
        let folder = std::env::temp_dir().join(format!("lf-warnings-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let logs = ["a.txt", "b.txt", "done.txt"].map(|name| folder.join(name));
        let warning = "lf-mart: warning: <dark>";
        std::fs::write(&logs[0], format!("lf-mart: kept 5\n{warning}\n")).unwrap();
        std::fs::write(&logs[1], format!("{warning}\nlf-mart: a.lfv: empty; wanted a .lfv file\n")).unwrap();
        std::fs::write(&logs[2], warning).unwrap();
        let found = lines(&logs);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(found[0], (warning.to_owned(), vec!["a".to_owned(), "b".to_owned()]));
        assert_eq!(found.len(), 2);
        let html = list(&found, &[]);
        assert!(html.contains("2 warnings") && html.contains("&lt;dark&gt;") && html.contains("(a, b)"), "{html}");
    }
}
