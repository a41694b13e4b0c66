//! A picture as a PDF of one page, with text as outlines.
//!
//! Source: ISO 32000-1. The file has a catalogue, a list of pages, one page, its content and the opacities that it uses,
//! then a table of where each object begins.

use super::outline::Piece;
use super::shapes::{Drawing, Paint};
use std::fmt::Write;

/// Points of the page to a pixel of the picture.
const POINTS: f32 = 0.75;

/// The picture as a PDF. Equal pictures give equal bytes.
pub(super) fn pdf(drawing: &Drawing) -> Vec<u8> {
    let mut opacities: Vec<f32> = drawing.shapes.iter().map(|shape| shape.opacity).collect();
    opacities.sort_by(f32::total_cmp);
    opacities.dedup();
    let [width, height] = drawing.size.map(|side| POINTS * side);
    let states: String = opacities.iter().enumerate().map(|(n, a)| format!("/g{n} << /ca {a} /CA {a} >> ")).collect();
    let content = content(drawing, &opacities);
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R /Resources << /ExtGState << \
             {states}>> >> >>"
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
    text.into_bytes()
}

/// The drawing commands, in pixels with y downwards.
fn content(drawing: &Drawing, opacities: &[f32]) -> String {
    let mut text = format!("{POINTS} 0 0 -{POINTS} 0 {} cm\n", POINTS * drawing.size[1]);
    let mut last = None;
    for shape in &drawing.shapes {
        let state = opacities.iter().position(|opacity| *opacity == shape.opacity).unwrap_or(0);
        let [red, green, blue] = shape.colour.map(|part| (f32::from(part) / 2.55).round() * 0.01);
        let look = (state, shape.colour, shape.paint);
        if last != Some(look) {
            let _ = write!(text, "/g{state} gs {red} {green} {blue} ");
            let _ = match shape.paint {
                Paint::Fill => writeln!(text, "rg"),
                Paint::Stroke(width) => writeln!(text, "RG {width} w"),
            };
            last = Some(look);
        }
        shape.outline.iter().for_each(|piece| write_piece(&mut text, piece));
        text.push_str(if shape.paint == Paint::Fill { "f\n" } else { "S\n" });
    }
    text
}

fn write_piece(text: &mut String, piece: &Piece) {
    let short = |value: f32| (100.0 * value).round() * 0.01;
    let mut place = |[x, y]: [f32; 2]| {
        let _ = write!(text, "{:.2} {:.2} ", short(x), short(y));
    };
    let command = match *piece {
        Piece::Move(at) => {
            place(at);
            "m "
        }
        Piece::Line(at) => {
            place(at);
            "l "
        }
        Piece::Curve(places) => {
            places.into_iter().for_each(place);
            "c "
        }
        Piece::Close => "h ",
    };
    text.push_str(command);
}

#[cfg(test)]
mod tests {
    use super::super::shapes::Shape;
    use super::*;

    #[test]
    fn the_table_of_a_pdf_points_at_its_objects() {
        let outline = vec![Piece::Move([0.0, 0.0]), Piece::Line([4.0, 8.0])];
        let shape = Shape { outline, paint: Paint::Stroke(2.0), colour: [255, 0, 128], opacity: 0.5 };
        let text = String::from_utf8(pdf(&Drawing { size: [40.0, 20.0], shapes: vec![shape] })).unwrap();
        let start: usize = text.rsplit("startxref\n").next().unwrap().lines().next().unwrap().parse().unwrap();
        assert!(text[start..].starts_with("xref\n0 5\n"));
        for (n, line) in text[start..].lines().skip(3).take(4).enumerate() {
            let at: usize = line[..10].parse().unwrap();
            assert!(text[at..].starts_with(&format!("{} 0 obj\n", n + 1)), "{line}");
        }
        assert!(text.contains("/MediaBox [0 0 30 15]") && text.contains("/ca 0.5"));
        assert!(text.contains("1 0 0.5 RG 2 w\n0.00 0.00 m 4.00 8.00 l S\n"), "{text}");
    }
}
