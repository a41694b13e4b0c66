//! A drawing as SVG, with text as text.

use super::drawing::{Drawing, DrawnShape, Form, Pixel, TextLine};
use super::palette::Colour;
use super::text::{Anchor, letter_px};
use std::fmt::Write;

impl Drawing {
    /// The drawing as the text of an SVG.
    pub fn svg(&self) -> String {
        let ([width, height], title) = (self.size, escaped(&self.title));
        let mut svg = format!(
            "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             xmlns=\"http://www.w3.org/2000/svg\">\n<title>{title}</title>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#FFFFFF\"/>\n"
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
    let mut paint = match shape.stroke_px {
        Some(width) => format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\""),
        None => format!("fill=\"{colour}\""),
    };
    if shape.opacity < 1.0 {
        let _ = write!(paint, " opacity=\"{}\"", shape.opacity);
    }
    let _ = match &shape.form {
        Form::Rectangle([(x, y), (right, low)]) => {
            let [width, height] = [right - x, low - y];
            writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" {paint}/>")
        }
        Form::Line(places) => writeln!(svg, "<polyline {paint} points=\"{}\"/>", points(places)),
        Form::Polygon(places) => writeln!(svg, "<polygon {paint} points=\"{}\"/>", points(places)),
        Form::Circle((x, y), radius) => writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" {paint}/>"),
        Form::Text(line) => writeln!(svg, "<text {} {paint}>\n{}\n</text>", attributes(line), escaped(&line.text)),
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
    let size = letter_px(line.size_px);
    format!(
        "x=\"{x}\" y=\"{y}\" dy=\"0.5ex\" text-anchor=\"{anchor}\" font-family=\"sans-serif\" font-size=\"{size:.2}\"{turn}"
    )
}

/// A text that cannot become markup.
fn escaped(text: &str) -> String {
    let codes = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;")];
    codes.iter().fold(text.to_owned(), |text, (letter, code)| text.replace(letter, code))
}
