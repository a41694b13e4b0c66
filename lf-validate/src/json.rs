//! JSON that people read: a key a line, and a list of numbers on one.

use serde::Serialize;
use serde_json::ser::{CompactFormatter, Formatter, PrettyFormatter};
use std::io::{self, Write};

/// `score` as text that ends in a line break.
///
/// # Errors
/// What serialising to memory can end in: a key that is no text.
pub fn text(score: &impl Serialize) -> serde_json::Result<String> {
    let mut bytes = Vec::new();
    score.serialize(&mut serde_json::Serializer::with_formatter(&mut bytes, Layout::default()))?;
    bytes.push(b'\n');
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Objects in lines, lists and what is in them in one line.
#[derive(Default)]
struct Layout {
    lists: usize,
    objects: PrettyFormatter<'static>,
}

/// Passes a call on to the layout that holds here.
macro_rules! pass {
    ($($call:ident($($name:ident: $kind:ty),*)),* $(,)?) => {
        $(fn $call<W: ?Sized + Write>(&mut self, writer: &mut W, $($name: $kind),*) -> io::Result<()> {
            if self.lists > 0 { CompactFormatter.$call(writer, $($name),*) } else { self.objects.$call(writer, $($name),*) }
        })*
    };
}

impl Formatter for Layout {
    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.lists += 1;
        writer.write_all(b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.lists -= 1;
        writer.write_all(b"]")
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        writer.write_all(if first { b"" } else { b", " })
    }

    fn end_array_value<W: ?Sized + Write>(&mut self, _: &mut W) -> io::Result<()> {
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
