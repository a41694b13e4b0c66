//! The letters of pictures that are not SVG: DejaVu Sans, the font whose widths lay out all pictures.

use lf_core::Refusal;
use tiny_skia::{Path, PathBuilder};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// A part of DejaVu Sans; its licence is beside it.
const DATA: &[u8] = include_bytes!("font/DejaVuSans.ttf");

/// Lengths are those of letters of size 1.
pub(super) struct Font {
    face: Face<'static>,
    unit: f32,
}

impl Font {
    pub fn new() -> Result<Self, Refusal> {
        let face =
            Face::parse(DATA, 0).map_err(|error| Refusal::new(error.to_string(), "wanted the font of pictures"))?;
        let unit = 1.0 / f32::from(face.units_per_em());
        Ok(Self { face, unit })
    }

    /// Height of a small letter.
    pub fn x_height(&self) -> f32 {
        self.face.x_height().map_or(0.55, |height| f32::from(height) * self.unit)
    }

    /// A letter that the font lacks is drawn as `?`.
    fn glyph(&self, letter: char) -> GlyphId {
        self.face.glyph_index(letter).or_else(|| self.face.glyph_index('?')).unwrap_or_default()
    }

    fn advance(&self, glyph: GlyphId) -> f32 {
        self.face.glyph_hor_advance(glyph).map_or(0.0, |width| f32::from(width) * self.unit)
    }

    pub fn width(&self, text: &str) -> f32 {
        text.chars().map(|letter| self.advance(self.glyph(letter))).sum()
    }

    /// The outlines of a text, with y downwards, from the left end of its base line. None if it has only spaces.
    pub fn outline(&self, text: &str) -> Option<Path> {
        let mut pen = Pen { unit: self.unit, start: 0.0, path: PathBuilder::new() };
        for letter in text.chars() {
            let glyph = self.glyph(letter);
            self.face.outline_glyph(glyph, &mut pen);
            pen.start += self.advance(glyph);
        }
        pen.path.finish()
    }
}

/// Takes the outline of a letter that starts at `start`.
struct Pen {
    unit: f32,
    start: f32,
    path: PathBuilder,
}

impl Pen {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        (self.start + x * self.unit, -y * self.unit)
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.path.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.path.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}
