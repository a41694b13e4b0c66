//! A drawing as PDF of one page, with text as outlines.
//!
//! Source: ISO 32000-1. The file has a catalogue, a list of pages, one page, and its content. A table of where each
//! object begins ends it.

use super::drawing::Drawing;
use super::{font::Font, outline::outline, palette::Colour};
use lf_core::Refusal;
use std::fmt::Write;
use tiny_skia::{Path, PathSegment, Point};

/// Points of the page to a pixel of the drawing.
const POINTS: f32 = 0.75;

/// The drawing as a PDF. Equal drawings give equal bytes.
pub(super) fn pdf(drawing: &Drawing) -> Result<Vec<u8>, Refusal> {
    let [width, height] = drawing.size.map(|side| POINTS * side as f32);
    let content = content(drawing, &Font::new()?);
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R /Resources << /ExtGState << \
             /g0 << /ca 1 /CA 1 >> >> >> >>"
        ),
        format!("<< /Length {} >>\nstream\n{content}endstream", content.len()),
    ];
    let mut text = "%PDF-1.4\n".to_owned();
    let mut table = format!("xref\n0 {}\n0000000000 65535 f \n", objects.len() + 1);
    for (n, object) in objects.iter().enumerate() {
        let _ = writeln!(table, "{:010} 00000 n ", text.len());
        let _ = write!(text, "{} 0 obj\n{object}\nendobj\n", n + 1);
    }
    let start = text.len();
    let _ = write!(text, "{table}trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n", objects.len() + 1);
    Ok(text.into_bytes())
}

/// The drawing commands, in pixels with y downwards.
fn content(drawing: &Drawing, font: &Font) -> String {
    let mut text = format!("{POINTS} 0 0 -{POINTS} 0 {} cm\n", POINTS * drawing.size[1] as f32);
    let mut last = None;
    for shape in &drawing.shapes {
        let Some(path) = outline(&shape.geometry, font) else { continue };
        let look = (shape.colour, shape.stroke);
        if last != Some(look) {
            let Colour(red, green, blue) = shape.colour;
            let [red, green, blue] = [red, green, blue].map(|part| (f32::from(part) / 2.55).round() * 0.01);
            let _ = write!(text, "/g0 gs {red} {green} {blue} ");
            let _ = match shape.stroke {
                None => writeln!(text, "rg"),
                Some(stroke) => {
                    let dashes =
                        stroke.dashes.map_or(String::new(), |dashes| dashes.map(|px| px.to_string()).join(" "));
                    writeln!(text, "RG {} w [{dashes}] 0 d", stroke.width_px)
                }
            };
            last = Some(look);
        }
        write_path(&mut text, &path);
        text.push_str(if shape.stroke.is_none() { "f\n" } else { "S\n" });
    }
    text
}

fn write_path(text: &mut String, path: &Path) {
    let mut last = Point::zero();
    for segment in path.segments() {
        let (places, command) = match segment {
            PathSegment::MoveTo(to) => (vec![to], "m"),
            PathSegment::LineTo(to) => (vec![to], "l"),
            // A PDF has curves of the third degree only.
            PathSegment::QuadTo(handle, to) => {
                let share = |end: f32, handle: f32| end + (handle - end) * 2.0 / 3.0;
                let two_thirds = |end: Point| Point::from_xy(share(end.x, handle.x), share(end.y, handle.y));
                (vec![two_thirds(last), two_thirds(to), to], "c")
            }
            PathSegment::CubicTo(one, other, to) => (vec![one, other, to], "c"),
            PathSegment::Close => (vec![], "h"),
        };
        for place in &places {
            let _ = write!(text, "{:.2} {:.2} ", place.x, place.y);
        }
        text.push_str(command);
        text.push(' ');
        last = places.last().copied().unwrap_or(last);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_a_pdf_points_at_its_objects() {
        let mut drawing = Drawing::new("", [40, 20]);
        drawing.line([(0, 0), (4, 8)], Colour(255, 0, 128), 2);
        drawing.block([(1, 2), (3, 4)], Colour(0, 0, 0));
        let text = String::from_utf8(pdf(&drawing).unwrap()).unwrap();
        let start: usize = text.rsplit("startxref\n").next().unwrap().lines().next().unwrap().parse().unwrap();
        assert!(text[start..].starts_with("xref\n0 5\n"));
        for (n, line) in text[start..].lines().skip(3).take(4).enumerate() {
            let at: usize = line[..10].parse().unwrap();
            assert!(text[at..].starts_with(&format!("{} 0 obj\n", n + 1)), "{line}");
        }
        assert!(text.contains("/MediaBox [0 0 30 15]"));
        assert!(text.contains("1 0 0.5 RG 2 w [] 0 d\n0.00 0.00 m 4.00 8.00 l S\n"), "{text}");
        assert!(text.contains("1.00 2.00 m 3.00 2.00 l 3.00 4.00 l 1.00 4.00 l h f\n"), "{text}");
    }
}
