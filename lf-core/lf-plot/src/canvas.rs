//! A canvas of pixels that becomes an SVG. Only this file knows the drawing library.

use super::palette::{Colour, INK};
use super::text::Anchor;
use lf_core::Refusal;
use plotters::coord::Shift;
use plotters::element::{Drawable, PointCollection};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A place on a canvas, px: to the right of its left edge and below its upper one.
pub type At = [f64; 2];

/// A place on a canvas in whole px: column, row.
pub type Pixel = (i32, i32);

/// The whole pixel nearest to a place.
pub fn rounded([x, y]: At) -> Pixel {
    (x.round() as i32, y.round() as i32)
}

/// A white canvas. Later strokes cover earlier ones.
pub struct Canvas<'a> {
    area: DrawingArea<SVGBackend<'a>, Shift>,
    /// The first failure of the drawing library.
    failure: Option<String>,
}

/// An SVG of `[width, height]` px, and the result of `draw`. A refusal is a failure of the drawing library, in its
/// words.
pub fn svg<T>(size: [i32; 2], draw: impl FnOnce(&mut Canvas) -> T) -> Result<(String, T), Refusal> {
    let mut text = String::new();
    let (result, failure) = {
        let area = SVGBackend::with_string(&mut text, (size[0] as u32, size[1] as u32)).into_drawing_area();
        let mut canvas = Canvas { area, failure: None };
        canvas.keep(canvas.area.fill(&WHITE));
        let result = draw(&mut canvas);
        canvas.keep(canvas.area.present());
        (result, canvas.failure)
    };
    failure.map_or(Ok((text, result)), |failure| Err(Refusal::new(failure, "wanted a picture")))
}

impl<'a> Canvas<'a> {
    /// A filled rectangle between two corners.
    pub fn block(&mut self, corners: [Pixel; 2], colour: Colour) {
        self.add(&Rectangle::new(corners, rgb(colour).filled()));
    }

    /// The outline of a rectangle, 1 px wide.
    pub fn frame(&mut self, corners: [Pixel; 2], colour: Colour) {
        self.add(&Rectangle::new(corners, rgb(colour)));
    }

    /// A translucent rectangle; an opacity of 1 hides everything below it.
    pub fn tint(&mut self, corners: [Pixel; 2], colour: Colour, opacity: f64) {
        self.add(&Rectangle::new(corners, rgb(colour).mix(opacity).filled()));
    }

    /// A line through places.
    pub fn line(&mut self, places: impl IntoIterator<Item = Pixel>, colour: Colour, width_px: u32) {
        self.add(&PathElement::new(places.into_iter().collect::<Vec<_>>(), rgb(colour).stroke_width(width_px)));
    }

    /// A plus sign.
    pub fn plus(&mut self, (x, y): Pixel, colour: Colour) {
        self.line([(x - 5, y), (x + 5, y)], colour, 2);
        self.line([(x, y - 5), (x, y + 5)], colour, 2);
    }

    /// A filled polygon; an opacity of 1 hides everything below it.
    pub fn polygon(&mut self, corners: impl IntoIterator<Item = Pixel>, colour: Colour, opacity: f64) {
        self.add(&Polygon::new(corners.into_iter().collect::<Vec<_>>(), rgb(colour).mix(opacity).filled()));
    }

    /// A filled circle.
    pub fn disc(&mut self, centre: Pixel, radius_px: i32, colour: Colour) {
        self.add(&Circle::new(centre, radius_px, rgb(colour).filled()));
    }

    /// The outline of a circle, 1 px wide.
    pub fn ring(&mut self, centre: Pixel, radius_px: i32, colour: Colour) {
        self.add(&Circle::new(centre, radius_px, rgb(colour)));
    }

    /// A line of text. `place` is its left end, middle or right end, at half its height.
    pub fn text(&mut self, text: &str, place: Pixel, size_px: i32, anchor: Anchor) {
        let style = ("sans-serif", size_px).into_font().color(&rgb(INK)).pos(position(anchor));
        self.add(&Text::new(text.to_owned(), place, style));
    }

    /// A line of text that reads upwards. `place` is its middle.
    pub fn upright_text(&mut self, text: &str, place: Pixel, size_px: i32) {
        let font = ("sans-serif", size_px).into_font().transform(FontTransform::Rotate270);
        self.add(&Text::new(text.to_owned(), place, font.color(&rgb(INK)).pos(position(Anchor::Middle))));
    }

    fn add<E: Drawable<SVGBackend<'a>>>(&mut self, element: &E)
    where
        for<'e> &'e E: PointCollection<'e, Pixel>,
    {
        self.keep(self.area.draw(element));
    }

    fn keep(&mut self, result: Result<(), impl std::fmt::Display>) {
        if let Err(failure) = result {
            self.failure.get_or_insert(failure.to_string());
        }
    }
}

fn rgb(Colour(red, green, blue): Colour) -> RGBColor {
    RGBColor(red, green, blue)
}

fn position(anchor: Anchor) -> Pos {
    let across = match anchor {
        Anchor::Left => HPos::Left,
        Anchor::Middle => HPos::Center,
        Anchor::Right => HPos::Right,
    };
    Pos::new(across, VPos::Center)
}
