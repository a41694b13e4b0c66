//! Pieces of HTML.

use base64::prelude::{BASE64_STANDARD, Engine};
use lf_plot::{Chart, Drawing, draw, draw_apart};

/// Constant: least width of a chart of one panel, px. Text stays readable on a narrow screen: there the chart is wider
/// than the screen and scrolls.
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

    /// Adds a chart with a line that explains it. Panels beside each other stack where the screen is narrow. A chart
    /// that cannot be drawn is left out.
    pub fn chart(&mut self, chart: &Chart, caption: &str) {
        let (title, caption) = (escape(&chart.title), escape(caption));
        let svg = |drawing: &Drawing, name: &str, style: &str| {
            drawing.svg().replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{name}\"{style} "), 1)
        };
        let picture = if chart.columns.min(chart.panels.len()) > 1 {
            let Ok(drawings) = draw_apart(chart) else { return };
            let names = chart.panels.iter().map(|panel| format!("{title}: {}", escape(&panel.y.name)));
            let panels: String = drawings.iter().zip(names).map(|(drawing, name)| svg(drawing, &name, "")).collect();
            format!("<h3>{title}</h3><div class=\"panels\">{panels}</div>")
        } else {
            let Ok(drawing) = draw(chart) else { return };
            let style = format!(" style=\"min-width:{ALONE_PX}px\"");
            format!("<div class=\"wide\" tabindex=\"0\">{}</div>", svg(&drawing, &title, &style))
        };
        self.content += &format!("<figure>{picture}<figcaption>{caption}</figcaption></figure>\n");
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
