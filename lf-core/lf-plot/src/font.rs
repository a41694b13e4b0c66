//! The letters of pictures that are not SVG: DejaVu Sans, the font whose widths lay out all pictures.

use lf_core::Refusal;
use tiny_skia::{Path, PathBuilder, Transform};
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
        let mut all = PathBuilder::new();
        let mut start = 0.0;
        for letter in text.chars() {
            let glyph = self.glyph(letter);
            let mut pen = Pen(PathBuilder::new());
            self.face.outline_glyph(glyph, &mut pen);
            let placed = Transform::from_row(self.unit, 0.0, 0.0, -self.unit, start, 0.0);
            if let Some(path) = pen.0.finish().and_then(|path| path.transform(placed)) {
                all.push_path(&path);
            }
            start += self.advance(glyph);
        }
        all.finish()
    }
}

/// Takes the outline of a letter, in units of the font.
struct Pen(PathBuilder);

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.0.close();
    }
}
