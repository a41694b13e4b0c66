//! A drawing: a page of shapes in pixels. `svg.rs`, `pixels.rs` and `pdf.rs` write it.

use super::palette::{Colour, Dashes, INK, PAPER};
use super::text::Anchor;

/// A place on a drawing, px: to the right of its left edge and below its upper one.
pub type At = [f64; 2];

/// A place on a drawing in whole px: column, row.
pub type Pixel = (i32, i32);

/// The whole pixel nearest to a place.
pub fn rounded([x, y]: At) -> Pixel {
    (x.round() as i32, y.round() as i32)
}

/// A white page with shapes on it. Later shapes cover earlier ones.
#[derive(Debug, Clone)]
pub struct Drawing {
    /// The subject, for readers who listen to the picture.
    pub(super) title: String,
    /// Width and height, px.
    pub(super) size: [i32; 2],
    pub(super) shapes: Vec<DrawnShape>,
}

/// A shape and how it is painted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DrawnShape {
    pub geometry: Geometry,
    pub colour: Colour,
    /// The stroke of its outline; a shape without one is filled.
    pub stroke: Option<Stroke>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stroke {
    pub width_px: u32,
    /// None for a solid line.
    pub dashes: Option<Dashes>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Geometry {
    /// The upper left and the lower right corner.
    Rectangle([Pixel; 2]),
    Line(Vec<Pixel>),
    Polygon(Vec<Pixel>),
    /// The centre and the radius.
    Circle(Pixel, i32),
    Text(TextLine),
}

/// A line of text. The middle of its height is at `place`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TextLine {
    pub text: String,
    pub place: Pixel,
    pub size_px: i32,
    pub anchor: Anchor,
    /// Whether it reads upwards.
    pub is_upright: bool,
}

/// The stroke of frames and rings.
const THIN: Stroke = Stroke { width_px: 1, dashes: None };

impl Drawing {
    /// A blank page of `[width, height]` px. The title is not drawn: it stands in the file.
    pub fn new(title: impl Into<String>, size: [i32; 2]) -> Self {
        let mut drawing = Self { title: title.into(), size, shapes: Vec::new() };
        drawing.block([(0, 0), (size[0], size[1])], PAPER);
        drawing
    }

    /// A filled rectangle between two corners.
    pub fn block(&mut self, corners: [Pixel; 2], colour: Colour) {
        self.fill(Geometry::Rectangle(corners), colour);
    }

    /// The outline of a rectangle, 1 px wide.
    pub fn frame(&mut self, corners: [Pixel; 2], colour: Colour) {
        self.stroke(Geometry::Rectangle(corners), colour, THIN);
    }

    /// A line through places.
    pub fn line(&mut self, places: impl IntoIterator<Item = Pixel>, colour: Colour, width_px: u32) {
        self.stroke(Geometry::Line(places.into_iter().collect()), colour, Stroke { width_px, dashes: None });
    }

    /// A line through places; without dashes it is solid.
    pub(super) fn curve(&mut self, places: &[At], colour: Colour, width_px: u32, dashes: Option<Dashes>) {
        let mut places: Vec<Pixel> = places.iter().copied().map(rounded).collect();
        places.dedup();
        self.stroke(Geometry::Line(places), colour, Stroke { width_px, dashes });
    }

    /// A plus sign.
    pub fn plus(&mut self, (x, y): Pixel, colour: Colour) {
        self.line([(x - 5, y), (x + 5, y)], colour, 2);
        self.line([(x, y - 5), (x, y + 5)], colour, 2);
    }

    /// A filled polygon.
    pub fn polygon(&mut self, corners: impl IntoIterator<Item = Pixel>, colour: Colour) {
        self.fill(Geometry::Polygon(corners.into_iter().collect()), colour);
    }

    /// A filled circle.
    pub fn disc(&mut self, centre: Pixel, radius_px: i32, colour: Colour) {
        self.fill(Geometry::Circle(centre, radius_px), colour);
    }

    /// The outline of a circle, 1 px wide.
    pub fn ring(&mut self, centre: Pixel, radius_px: i32, colour: Colour) {
        self.stroke(Geometry::Circle(centre, radius_px), colour, THIN);
    }

    /// A line of text. `place` is its left end, middle or right end, at half its height.
    pub fn text(&mut self, text: &str, place: Pixel, size_px: i32, anchor: Anchor) {
        self.letters(TextLine { text: text.to_owned(), place, size_px, anchor, is_upright: false });
    }

    /// A line of text that reads upwards. `place` is its middle.
    pub fn upright_text(&mut self, text: &str, place: Pixel, size_px: i32) {
        self.letters(TextLine { text: text.to_owned(), place, size_px, anchor: Anchor::Middle, is_upright: true });
    }

    fn letters(&mut self, line: TextLine) {
        self.fill(Geometry::Text(line), INK);
    }

    fn fill(&mut self, geometry: Geometry, colour: Colour) {
        self.shapes.push(DrawnShape { geometry, colour, stroke: None });
    }

    fn stroke(&mut self, geometry: Geometry, colour: Colour, stroke: Stroke) {
        self.shapes.push(DrawnShape { geometry, colour, stroke: Some(stroke) });
    }
}
