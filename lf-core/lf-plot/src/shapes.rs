//! The shapes of an SVG that this program drew: rectangles, lines, polygons, circles and lines of text.

use super::font::Font;
use super::outline::Piece;
use lf_core::Refusal;

/// How a shape is painted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Paint {
    Fill,
    /// A stroke of this width, px.
    Stroke(f32),
}

/// One shape; later ones cover earlier ones.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    pub outline: Vec<Piece>,
    pub paint: Paint,
    pub colour: [u8; 3],
    pub opacity: f32,
}

/// All shapes of a picture of `size` px.
#[derive(Debug)]
pub(super) struct Drawing {
    pub size: [f32; 2],
    pub shapes: Vec<Shape>,
}

impl Drawing {
    /// Reads an SVG of ours. Refuses an element that it does not know.
    pub fn parse(svg: &str) -> Result<Self, Refusal> {
        let font = Font::new()?;
        let mut drawing = Self { size: [0.0; 2], shapes: Vec::new() };
        for element in svg.split('<').skip(1) {
            let (tag, text) = element.split_once('>').unwrap_or((element, ""));
            let name = tag.split_whitespace().next().unwrap_or_default();
            let known = match name {
                "svg" => numbers(tag, ["width", "height"]).map(|size| drawing.size = size),
                "/svg" | "/text" => Some(()),
                "text" => letters(&font, tag, text).map(|shape| drawing.shapes.push(shape)),
                _ => outline(name, tag).and_then(|outline| drawing.paint(outline, tag)),
            };
            known.ok_or_else(|| Refusal::new(format!("an SVG with <{tag}>"), "wanted one that this program drew"))?;
        }
        Ok(drawing)
    }

    /// Adds the shapes of an element: what is filled, then what is stroked.
    fn paint(&mut self, outline: Vec<Piece>, tag: &str) -> Option<()> {
        let opacity = number(tag, "opacity").unwrap_or(1.0);
        if let Some(colour) = attribute(tag, "fill").and_then(colour) {
            self.shapes.push(Shape { outline: outline.clone(), paint: Paint::Fill, colour, opacity });
        }
        if let Some(colour) = attribute(tag, "stroke").and_then(colour) {
            let paint = Paint::Stroke(number(tag, "stroke-width").unwrap_or(1.0));
            self.shapes.push(Shape { outline, paint, colour, opacity });
        }
        Some(())
    }
}

/// The outline of an element that is no text.
fn outline(name: &str, tag: &str) -> Option<Vec<Piece>> {
    match name {
        "rect" => {
            let [x, y, width, height] = numbers(tag, ["x", "y", "width", "height"])?;
            Some(joined(&[[x, y], [x + width, y], [x + width, y + height], [x, y + height]], true))
        }
        "line" => {
            let [x1, y1, x2, y2] = numbers(tag, ["x1", "y1", "x2", "y2"])?;
            Some(joined(&[[x1, y1], [x2, y2]], false))
        }
        "polyline" | "polygon" => {
            let place = |pair: &str| {
                let (x, y) = pair.split_once(',')?;
                Some([x.parse().ok()?, y.parse().ok()?])
            };
            let places = attribute(tag, "points")?.split_whitespace().map(place).collect::<Option<Vec<_>>>()?;
            Some(joined(&places, name == "polygon"))
        }
        "circle" => numbers(tag, ["cx", "cy", "r"]).map(circle),
        _ => None,
    }
}

fn joined(places: &[[f32; 2]], is_closed: bool) -> Vec<Piece> {
    let pieces = places.iter().enumerate().map(|(n, at)| if n == 0 { Piece::Move(*at) } else { Piece::Line(*at) });
    pieces.chain(is_closed.then_some(Piece::Close)).collect()
}

/// Four curves, which miss the circle by less than 0.03 % of its radius.
fn circle([x, y, r]: [f32; 3]) -> Vec<Piece> {
    const HANDLE: f32 = 0.552_285;
    let at = |right: f32, down: f32| [x + r * right, y + r * down];
    let quarter = |[a, b]: [f32; 2], [c, d]: [f32; 2]| {
        Piece::Curve([at(a + HANDLE * c, b + HANDLE * d), at(c + HANDLE * a, d + HANDLE * b), at(c, d)])
    };
    let corners = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
    let curves = (0..4).map(|n| quarter(corners[n], corners[(n + 1) % 4]));
    [Piece::Move(at(1.0, 0.0))].into_iter().chain(curves).chain([Piece::Close]).collect()
}

/// A line of text: it stands half an x-height below its place, and may be turned about it.
fn letters(font: &Font, tag: &str, text: &str) -> Option<Shape> {
    let [x, y, size] = numbers(tag, ["x", "y", "font-size"])?;
    let text = unescaped(text.trim());
    let share = match attribute(tag, "text-anchor") {
        Some("middle") => 0.5,
        Some("end") => 1.0,
        _ => 0.0,
    };
    let shift = [-share * font.width(&text) * size, 0.5 * font.x_height() * size];
    let degrees =
        attribute(tag, "transform").and_then(|turn| turn.strip_prefix("rotate(")?.split(',').next()?.parse().ok());
    let (sin, cos) = degrees.unwrap_or(0f32).to_radians().sin_cos();
    let place = |[right, up]: [f32; 2]| {
        let [right, down] = [shift[0] + right * size, shift[1] - up * size];
        [x + cos * right - sin * down, y + sin * right + cos * down]
    };
    let opacity = number(tag, "opacity").unwrap_or(1.0);
    let colour = attribute(tag, "fill").and_then(colour)?;
    Some(Shape { outline: font.outline(&text, &place), paint: Paint::Fill, colour, opacity })
}

fn unescaped(text: &str) -> String {
    let pairs = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&#39;", "'"), ("&amp;", "&")];
    pairs.iter().fold(text.to_owned(), |text, (escaped, plain)| text.replace(escaped, plain))
}

fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    let start = tag.find(&format!(" {name}=\""))? + name.len() + 3;
    tag[start..].split('"').next()
}

fn number(tag: &str, name: &str) -> Option<f32> {
    attribute(tag, name)?.parse().ok()
}

fn numbers<const N: usize>(tag: &str, names: [&str; N]) -> Option<[f32; N]> {
    let mut found = [0.0; N];
    for (value, name) in found.iter_mut().zip(names) {
        *value = number(tag, name)?;
    }
    Some(found)
}

/// The colour of `#RRGGBB`; None for `none`.
fn colour(text: &str) -> Option<[u8; 3]> {
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.is_ascii())?;
    let part = |n: usize| u8::from_str_radix(&digits[2 * n..2 * n + 2], 16).ok();
    Some([part(0)?, part(1)?, part(2)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    const SVG: &str = "<svg width=\"40\" height=\"20\" viewBox=\"0 0 40 20\" xmlns=\"http://www.w3.org/2000/svg\">\n\
        <rect x=\"1\" y=\"2\" width=\"3\" height=\"4\" opacity=\"0.5\" fill=\"#FF8000\" stroke=\"none\"/>\n\
        <polyline fill=\"none\" opacity=\"1\" stroke=\"#191923\" stroke-width=\"2\" points=\"1,2 3,4 \"/>\n\
        <circle cx=\"9\" cy=\"9\" r=\"2\" opacity=\"1\" fill=\"#FFFFFF\" stroke=\"#000000\" stroke-width=\"1\"/>\n\
        <text x=\"20\" y=\"10\" dy=\"0.5ex\" text-anchor=\"middle\" font-family=\"sans-serif\" font-size=\"10\" \
        opacity=\"1\" fill=\"#191923\">\na &lt; b\n</text>\n</svg>\n";

    #[test]
    fn every_element_becomes_its_shapes() {
        let drawing = Drawing::parse(SVG).unwrap();
        assert_eq!((drawing.size, drawing.shapes.len()), ([40.0, 20.0], 5));
        let [rectangle, line, disc, ring, text] = &drawing.shapes[..] else { panic!("five shapes") };
        assert_eq!((rectangle.colour, rectangle.opacity, rectangle.paint), ([255, 128, 0], 0.5, Paint::Fill));
        assert_eq!(line.outline, [Piece::Move([1.0, 2.0]), Piece::Line([3.0, 4.0])]);
        assert_eq!((line.paint, disc.paint, ring.paint), (Paint::Stroke(2.0), Paint::Fill, Paint::Stroke(1.0)));
        // The text is centred on its place.
        let places = text.outline.iter().filter_map(|piece| match piece {
            Piece::Move([x, _]) | Piece::Line([x, _]) => Some(*x),
            _ => None,
        });
        let (low, high) = places.fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)));
        assert!((0.5 * (low + high) - 20.0).abs() < 1.0 && high - low > 15.0, "{low} {high}");
        assert!(Drawing::parse("<svg width=\"1\" height=\"1\"><image/></svg>").is_err());
    }
}
