//! Where a score goes: to standard output as JSON that people read, and into a picture.

use lf_core::plot::{self, Chart};
use lf_core::{Error, Result, Session, io};
use serde::Serialize;
use serde_json::ser::{CompactFormatter, Formatter, PrettyFormatter};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Where the picture goes.
#[derive(Default, clap::Args)]
pub struct Picture {
    /// Draw the result
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

impl Picture {
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

    /// Draws and saves the chart if `--plot` is given.
    pub fn draw(&self, session: &mut Session, chart: impl FnOnce() -> Chart) -> Result<()> {
        self.drawn(session, chart).and_then(|svg| self.save(&svg))
    }

    /// The chart as SVG; empty without `--plot`.
    pub fn drawn(&self, session: &mut Session, chart: impl FnOnce() -> Chart) -> Result<String> {
        let Some(file) = &self.plot else { return Ok(String::new()) };
        session.phase("plot", |_| plot::draw(&chart()).map_err(|refusal| refusal.about(io::output_name(file))))
    }

    /// Saves a chart that was drawn.
    pub fn save(&self, svg: &str) -> Result<()> {
        let Some(file) = &self.plot else { return Ok(()) };
        io::save_text(file, |out| out.write_all(svg.as_bytes()))
    }
}

/// Prints one score on standard output.
pub fn print(score: &impl Serialize) -> Result<()> {
    let text = text(score).map_err(|error| Error::new("-", error.to_string(), "wanted a score"))?;
    io::save_text(Path::new("-"), |out| out.write_all(text.as_bytes()))
}

/// `score` as text that ends in a line break. Fails only if a key is not text.
fn text(score: &impl Serialize) -> serde_json::Result<String> {
    let mut bytes = Vec::new();
    score.serialize(&mut serde_json::Serializer::with_formatter(&mut bytes, JsonLayout::default()))?;
    bytes.push(b'\n');
    Ok(String::from_utf8_lossy(&bytes).into_owned())
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
    fn objects_take_lines_and_lists_do_not() {
        let score = json!({"a": 1, "b": [1.5, null, {"c": [2]}], "d": {"e": []}});
        let wanted = "{\n  \"a\": 1,\n  \"b\": [1.5, null, {\"c\":[2]}],\n  \"d\": {\n    \"e\": []\n  }\n}\n";
        assert_eq!(text(&score).unwrap(), wanted);
    }
}
