//! A drawing as SVG, with text as text.

use super::drawing::{Drawing, DrawnShape, Geometry, Pixel, TextLine};
use super::palette::Colour;
use super::text::{Anchor, letter_px};
use std::fmt::Write;

impl Drawing {
    /// The drawing as the text of an SVG.
    pub fn svg(&self) -> String {
        let ([width, height], title) = (self.size, escaped(&self.title));
        let mut svg = format!(
            "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             xmlns=\"http://www.w3.org/2000/svg\">\n<title>{title}</title>\n"
        );
        for shape in &self.shapes {
            write_shape(&mut svg, shape);
        }
        svg + "</svg>\n"
    }
}

fn write_shape(svg: &mut String, shape: &DrawnShape) {
    let Colour(red, green, blue) = shape.colour;
    let colour = format!("#{red:02X}{green:02X}{blue:02X}");
    let mut paint = match shape.stroke {
        Some(stroke) => format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"{}\"", stroke.width_px),
        None => format!("fill=\"{colour}\""),
    };
    if let Some([dash, gap, other, last]) = shape.stroke.and_then(|stroke| stroke.dashes) {
        let _ = write!(paint, " stroke-dasharray=\"{dash} {gap} {other} {last}\"");
    }
    let _ = match &shape.geometry {
        Geometry::Rectangle([(x, y), (right, low)]) => {
            let [width, height] = [right - x, low - y];
            writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" {paint}/>")
        }
        Geometry::Line(places) => writeln!(svg, "<polyline {paint} points=\"{}\"/>", points(places)),
        Geometry::Polygon(places) => writeln!(svg, "<polygon {paint} points=\"{}\"/>", points(places)),
        Geometry::Circle((x, y), radius) => writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" {paint}/>"),
        Geometry::Text(line) => writeln!(svg, "<text {} {paint}>\n{}\n</text>", attributes(line), escaped(&line.text)),
    };
}

fn points(places: &[Pixel]) -> String {
    places.iter().map(|(x, y)| format!("{x},{y}")).collect::<Vec<_>>().join(" ")
}

fn attributes(line: &TextLine) -> String {
    let (x, y) = line.place;
    let anchor = match line.anchor {
        Anchor::Left => "start",
        Anchor::Middle => "middle",
        Anchor::Right => "end",
    };
    let turn = if line.is_upright { format!(" transform=\"rotate(270, {x}, {y})\"") } else { String::new() };
    let font = format!("font-family=\"sans-serif\" font-size=\"{:.2}\"", letter_px(line.size_px));
    format!("x=\"{x}\" y=\"{y}\" dy=\"0.5ex\" text-anchor=\"{anchor}\" {font}{turn}")
}

/// A text that cannot become markup.
fn escaped(text: &str) -> String {
    let codes = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;")];
    codes.iter().fold(text.to_owned(), |text, (letter, code)| text.replace(letter, code))
}

#[cfg(test)]
mod tests {
    use super::super::palette::INK;
    use super::*;

    #[test]
    fn every_shape_becomes_its_element() {
        let mut drawing = Drawing::new("a < b", [40, 20]);
        drawing.block([(1, 2), (4, 6)], Colour(255, 128, 0));
        drawing.curve(&[[1.0, 2.0], [1.1, 2.2], [3.0, 4.0]], INK, 2, Some([7, 4, 7, 4]));
        drawing.ring((9, 8), 2, INK);
        drawing.upright_text("p & q", (20, 10), 15);
        let svg = drawing.svg();
        for line in [
            "<title>a &lt; b</title>",
            r##"<rect x="0" y="0" width="40" height="20" fill="#FFFFFF"/>"##,
            r##"<rect x="1" y="2" width="3" height="4" fill="#FF8000"/>"##,
            r##"<polyline fill="none" stroke="#191923" stroke-width="2" stroke-dasharray="7 4 7 4" points="1,2 3,4"/>"##,
            r##"<circle cx="9" cy="8" r="2" fill="none" stroke="#191923" stroke-width="1"/>"##,
            "p &amp; q",
        ] {
            assert!(svg.lines().any(|found| found == line), "{line} in {svg}");
        }
        assert!(svg.contains("text-anchor=\"middle\"") && svg.contains("rotate(270, 20, 10)"), "{svg}");
    }
}
