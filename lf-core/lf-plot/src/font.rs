//! The letters of pictures that are not SVG: DejaVu Sans, the font whose widths lay out all pictures.

use super::outline::Piece;
use lf_core::Refusal;
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

    /// The outlines of a text that starts at the origin of its line, with y upwards, moved by `place`.
    pub fn outline(&self, text: &str, place: &dyn Fn([f32; 2]) -> [f32; 2]) -> Vec<Piece> {
        let mut pen = Pen { unit: self.unit, start: 0.0, last: [0.0; 2], place, pieces: Vec::new() };
        for letter in text.chars() {
            let glyph = self.glyph(letter);
            self.face.outline_glyph(glyph, &mut pen);
            pen.start += self.advance(glyph);
        }
        pen.pieces
    }
}

/// Takes the outline of a letter that starts at `start`.
struct Pen<'a> {
    unit: f32,
    start: f32,
    last: [f32; 2],
    place: &'a dyn Fn([f32; 2]) -> [f32; 2],
    pieces: Vec<Piece>,
}

impl Pen<'_> {
    fn at(&self, x: f32, y: f32) -> [f32; 2] {
        (self.place)([self.start + x * self.unit, y * self.unit])
    }
}

impl OutlineBuilder for Pen<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        self.last = self.at(x, y);
        self.pieces.push(Piece::Move(self.last));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.last = self.at(x, y);
        self.pieces.push(Piece::Line(self.last));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let (from, handle, to) = (self.last, self.at(x1, y1), self.at(x, y));
        // A curve of the second degree as one of the third.
        let two_thirds = |end: [f32; 2]| [0, 1].map(|axis| end[axis] + (handle[axis] - end[axis]) * 2.0 / 3.0);
        self.pieces.push(Piece::Curve([two_thirds(from), two_thirds(to), to]));
        self.last = to;
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let curve = [self.at(x1, y1), self.at(x2, y2), self.at(x, y)];
        self.pieces.push(Piece::Curve(curve));
        self.last = curve[2];
    }

    fn close(&mut self) {
        self.pieces.push(Piece::Close);
    }
}
