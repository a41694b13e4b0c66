//! Pieces of HTML.

use base64::prelude::{BASE64_STANDARD, Engine};
use lf_plot::{Chart, draw};

/// Constant: least width of a panel beside others and of one alone on the screen, px.
const COLUMN_PX: usize = 340;
const ALONE_PX: usize = 480;

/// A section of the page: its anchor, its heading and its content.
pub(super) struct Section {
    pub anchor: &'static str,
    pub heading: &'static str,
    pub content: String,
}

impl Section {
    pub fn new(anchor: &'static str, heading: &'static str) -> Self {
        Self { anchor, heading, content: String::new() }
    }

    /// Adds a paragraph.
    pub fn text(&mut self, text: &str) {
        self.content += &format!("<p>{}</p>\n", escape(text));
    }

    /// Adds a table. Cells are text; the columns before `texts` are not numbers.
    pub fn table(&mut self, head: &[&str], rows: &[Vec<String>], texts: usize) {
        let heads: String = head.iter().map(|cell| format!("<th scope=\"col\">{}</th>", escape(cell))).collect();
        self.content += "<div class=\"wide\" tabindex=\"0\"><table>\n";
        if !head.is_empty() {
            self.content += &format!("<thead><tr>{heads}</tr></thead>\n");
        }
        for row in rows {
            let class = |n: usize| if n > 0 && n < texts { " class=\"text\"" } else { "" };
            let cells = row.iter().enumerate().map(|(n, cell)| format!("<td{}>{}</td>", class(n), escape(cell)));
            self.content += &format!("<tr>{}</tr>\n", cells.collect::<String>());
        }
        self.content += "</table></div>\n";
    }

    /// Adds a chart with a line that explains it. A chart that cannot be drawn is left out.
    pub fn chart(&mut self, chart: &Chart, caption: &str) {
        if let Ok(drawing) = draw(chart) {
            // Text stays readable on a narrow screen: there the chart is wider than the screen and scrolls.
            let columns = chart.columns.clamp(1, chart.panels.len().max(1));
            let least_px = if columns > 1 { COLUMN_PX * columns } else { ALONE_PX };
            let label = escape(&chart.title);
            let begin = format!("<svg role=\"img\" aria-label=\"{label}\" style=\"min-width:{least_px}px\" ");
            let svg = drawing.svg().replacen("<svg ", &begin, 1);
            let caption = escape(caption);
            self.content += &format!(
                "<figure><div class=\"wide\" tabindex=\"0\">{svg}</div><figcaption>{caption}</figcaption></figure>\n"
            );
        }
    }

    /// Adds lines of text that are shown on demand.
    pub fn details(&mut self, summary: &str, lines: &[String]) {
        let text = escape(&lines.join("\n"));
        self.content += &format!("<details><summary>{}</summary><pre>{text}</pre></details>\n", escape(summary));
    }
}

/// Text as it may stand in HTML and in a quoted attribute.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            letter if letter.is_control() && letter != '\n' => escaped.push(' '),
            letter => escaped.push(letter),
        }
    }
    escaped
}

pub(super) fn base64(bytes: &[u8]) -> String {
    BASE64_STANDARD.encode(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(escape("<b a=\"'\">&\u{7}"), "&lt;b a=&quot;&#39;&quot;&gt;&amp; ");
        let mut section = Section::new("a", "b");
        section.table(&["<x>"], &[vec!["</table>".into(), "1".into()]], 1);
        assert!(section.content.contains("&lt;/table&gt;") && !section.content.contains("<x>"), "{}", section.content);
    }
}
