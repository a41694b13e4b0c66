//! Where a score goes: to standard output as JSON that people read, and into a picture.

use lf_core::{Error, Result, Session, io};
use lf_plot::{Chart, Drawing};
use serde::Serialize;
use serde_json::Value;
use serde_json::ser::{CompactFormatter, Formatter, PrettyFormatter};
use std::io::{IsTerminal, Write, stdout};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Where the picture goes.
#[derive(Default, clap::Args)]
pub struct Picture {
    /// Draw the result
    #[arg(long, value_name = "FILE.svg|.png|.pdf")]
    plot: Option<PathBuf>,
}

impl Picture {
    /// The file of the picture.
    pub fn file(&self) -> Option<&Path> {
        self.plot.as_deref()
    }

    /// Refuses standard input named twice, and any output that is also an input: standard output, `--stats` or the
    /// picture. Refuses a picture on standard output, which is the score's.
    pub fn check<'a>(&self, inputs: impl IntoIterator<Item = &'a PathBuf>, session: &Session) -> Result<()> {
        let inputs: Vec<&Path> = inputs.into_iter().map(PathBuf::as_path).collect();
        session.keep_apart(Path::new("-"), &inputs)?;
        let Some(file) = &self.plot else { return Ok(()) };
        if io::is_standard(file) {
            return Err(Error::new("--plot", "-", "wanted a file: standard output is the score's"));
        }
        io::check_picture(file)?;
        session.keep_apart(file, &inputs)
    }

    /// Whether `--plot` is given.
    pub fn is_asked(&self) -> bool {
        self.plot.is_some()
    }

    /// Draws and saves the chart if `--plot` is given.
    pub fn draw(&self, session: &mut Session, chart: impl FnOnce() -> Chart) -> Result<()> {
        self.drawn(session, chart).and_then(|drawing| self.save(drawing.as_ref()))
    }

    /// Draws the chart; None without `--plot`.
    pub fn drawn(&self, session: &mut Session, chart: impl FnOnce() -> Chart) -> Result<Option<Drawing>> {
        let Some(file) = &self.plot else { return Ok(None) };
        session.phase("plot", |_| {
            lf_plot::draw(&chart()).map(Some).map_err(|refusal| refusal.about(io::output_name(file)))
        })
    }

    /// Saves a chart that was drawn.
    pub fn save(&self, drawing: Option<&Drawing>) -> Result<()> {
        self.plot.iter().zip(drawing).try_for_each(|(file, drawing)| lf_plot::save(file, drawing))
    }
}

/// Whether `--full` is given.
static IS_FULL: OnceLock<bool> = OnceLock::new();

/// Says, once, whether a terminal gets the whole score.
pub fn show_all(is_full: bool) {
    IS_FULL.get_or_init(|| is_full);
}

/// Prints one score on standard output: whole, or ten lines of it on a terminal without `--full`.
pub fn print(score: &impl Serialize) -> Result<()> {
    let is_brief = stdout().is_terminal() && !IS_FULL.get().is_some_and(|is_full| *is_full);
    if !is_brief {
        return io::save_text(Path::new("-"), |out| write_text(score, out));
    }
    let wrong = |error: serde_json::Error| Error::new("-", error.to_string(), "wanted a score");
    let text = brief(&serde_json::to_value(score).map_err(wrong)?);
    io::save_text(Path::new("-"), |out| out.write_all(text.as_bytes()))
}

/// Lines of a score on a terminal.
const LINES: usize = 10;
/// A longer list is left out of them.
const SHORT_LIST: usize = 3;

/// The first numbers of a score, and how many are left out. Numbers of the whole come before those of its parts and
/// before counts.
fn brief(score: &Value) -> String {
    let (mut lines, mut lists) = (Vec::new(), 0);
    collect("", 0, score, &mut lines, &mut lists);
    // Counts come after the numbers of a score.
    let is_count = |text: &str| !text.contains('.') && text != "null";
    lines.sort_by_key(|(depth, _, text)| (*depth, is_count(text)));
    if lines.len() <= LINES && lists == 0 {
        return lines.iter().map(|(_, key, value)| format!("{key}: {value}\n")).collect();
    }
    let left_out = lines.len().saturating_sub(LINES - 1);
    lines.truncate(LINES - 1);
    let width = lines.iter().map(|(_, key, _)| key.len()).max().unwrap_or(0);
    let shown: String = lines.iter().map(|(_, key, value)| format!("{key:width$}  {value}\n")).collect();
    format!("{shown}and {left_out} numbers and {lists} lists more: --full, or a pipe, for all as JSON\n")
}

/// Depth, key and text of every number of a score; counts the lists that are left out.
fn collect(key: &str, depth: usize, value: &Value, lines: &mut Vec<(usize, String, String)>, lists: &mut usize) {
    match value {
        Value::Object(map) => {
            for (name, value) in map {
                let key = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
                collect(&key, depth + 1, value, lines, lists);
            }
        }
        Value::Array(list) if list.len() > SHORT_LIST || list.iter().any(|item| item.is_object()) => *lists += 1,
        value => lines.push((depth, key.to_owned(), value.to_string().trim_matches('"').to_owned())),
    }
}

/// Writes `score` number by number, as text that ends in a line break. The text of a deep volume is longer than its
/// score.
fn write_text(score: &impl Serialize, mut out: &mut dyn Write) -> std::io::Result<()> {
    score.serialize(&mut serde_json::Serializer::with_formatter(&mut out, JsonLayout::default()))?;
    out.write_all(b"\n")
}

/// Puts each entry of an object on its own line, and a list with all that it holds on one line.
#[derive(Default)]
struct JsonLayout {
    /// Lists that are open.
    lists: usize,
    objects: PrettyFormatter<'static>,
}

/// Passes a call on: to the compact layout inside a list, else to the layout of objects.
macro_rules! pass {
    ($($call:ident($($name:ident: $kind:ty),*)),* $(,)?) => {
        $(fn $call<W: ?Sized + Write>(&mut self, writer: &mut W, $($name: $kind),*) -> std::io::Result<()> {
            if self.lists > 0 { CompactFormatter.$call(writer, $($name),*) } else { self.objects.$call(writer, $($name),*) }
        })*
    };
}

impl Formatter for JsonLayout {
    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> std::io::Result<()> {
        self.lists += 1;
        writer.write_all(b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> std::io::Result<()> {
        self.lists -= 1;
        writer.write_all(b"]")
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> std::io::Result<()> {
        writer.write_all(if first { b"" } else { b", " })
    }

    fn end_array_value<W: ?Sized + Write>(&mut self, _: &mut W) -> std::io::Result<()> {
        Ok(())
    }

    pass! {
        begin_object(), end_object(), begin_object_key(first: bool), begin_object_value(), end_object_value(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_terminal_gets_ten_lines_the_whole_first() {
        let parts: serde_json::Map<String, Value> = (0..20).map(|n| (format!("part_{n}"), json!(n))).collect();
        let score = json!({"deep": &parts, "profile": [1, 2, 3, 4], "q": 0.93, "shape": [1, 2, 3], "unit": "px"});
        let text = brief(&score);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 10, "{text}");
        assert_eq!(lines[0].split_whitespace().collect::<Vec<_>>(), ["q", "0.93"]);
        assert!(
            lines[1].ends_with("[1,2,3]") && lines[2].ends_with("px") && lines[3].starts_with("deep.part_0"),
            "{text}"
        );
        assert_eq!(lines[9], "and 14 numbers and 1 lists more: --full, or a pipe, for all as JSON");
        assert_eq!(brief(&json!({"q": null})), "q: null\n");
    }

    #[test]
    fn objects_take_lines_and_lists_do_not() {
        let score = json!({"a": 1, "b": [1.5, null, {"c": [2]}], "d": {"e": []}});
        let wanted = "{\n  \"a\": 1,\n  \"b\": [1.5, null, {\"c\":[2]}],\n  \"d\": {\n    \"e\": []\n  }\n}\n";
        let mut written = Vec::new();
        write_text(&score, &mut written).unwrap();
        assert_eq!(String::from_utf8(written).unwrap(), wanted);
    }
}
