//! A picture as pixels.

use super::outline::Piece;
use super::shapes::{Drawing, Paint, Shape};
use lf_core::Refusal;
use lf_core::image::picture_colour;
use tiny_skia::{Color, FillRule, Path, PathBuilder, Pixmap, Stroke, Transform};

/// Pixels of the PNG to a pixel of the picture: fine enough for print.
const FINER: f32 = 2.0;

/// The picture as a PNG.
pub(super) fn png(drawing: &Drawing) -> Result<Vec<u8>, Refusal> {
    let size = drawing.size.map(|side| (FINER * side).ceil() as u32);
    let too_large = || Refusal::new(format!("a picture of {} x {} px", size[0], size[1]), "wanted a smaller one");
    let mut pixmap = Pixmap::new(size[0], size[1]).ok_or_else(too_large)?;
    pixmap.fill(Color::WHITE);
    drawing.shapes.iter().for_each(|shape| paint(&mut pixmap, shape));
    let rgb: Vec<u8> = pixmap.pixels().iter().flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    picture_colour(size, &rgb)
}

fn paint(pixmap: &mut Pixmap, shape: &Shape) {
    let Some(path) = path(&shape.outline) else { return };
    let mut paint = tiny_skia::Paint::default();
    let [red, green, blue] = shape.colour;
    paint.set_color_rgba8(red, green, blue, (255.0 * shape.opacity).round() as u8);
    let finer = Transform::from_scale(FINER, FINER);
    match shape.paint {
        Paint::Fill => {
            // Neighbouring cells of a map must not show seams.
            paint.anti_alias = !is_upright_rectangle(&shape.outline);
            pixmap.fill_path(&path, &paint, FillRule::Winding, finer, None);
        }
        Paint::Stroke(width) => {
            pixmap.stroke_path(&path, &paint, &Stroke { width, ..Stroke::default() }, finer, None);
        }
    }
}

/// Whether an outline is a rectangle with sides along x and y.
fn is_upright_rectangle(outline: &[Piece]) -> bool {
    let [Piece::Move(a), Piece::Line(b), Piece::Line(c), Piece::Line(d), Piece::Close] = outline else { return false };
    [(a, b), (b, c), (c, d), (d, a)].into_iter().all(|(from, to)| from[0] == to[0] || from[1] == to[1])
}

fn path(outline: &[Piece]) -> Option<Path> {
    let mut path = PathBuilder::new();
    for piece in outline {
        match *piece {
            Piece::Move([x, y]) => path.move_to(x, y),
            Piece::Line([x, y]) => path.line_to(x, y),
            Piece::Curve([[a, b], [c, d], [x, y]]) => path.cubic_to(a, b, c, d, x, y),
            Piece::Close => path.close(),
        }
    }
    path.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colours(corners: [[f32; 2]; 4]) -> usize {
        let [first, rest @ ..] = corners;
        let lines = rest.map(Piece::Line);
        let outline = [Piece::Move(first)].into_iter().chain(lines).chain([Piece::Close]).collect();
        let mut pixmap = Pixmap::new(40, 40).unwrap();
        paint(&mut pixmap, &Shape { outline, paint: Paint::Fill, colour: [0, 0, 0], opacity: 1.0 });
        pixmap.pixels().iter().map(|pixel| pixel.alpha()).collect::<std::collections::BTreeSet<_>>().len()
    }

    #[test]
    fn only_upright_rectangles_have_hard_edges() {
        assert_eq!(colours([[2.3, 2.3], [9.7, 2.3], [9.7, 8.2], [2.3, 8.2]]), 2);
        assert!(colours([[2.0, 9.0], [9.0, 2.0], [16.0, 9.0], [9.0, 16.0]]) > 2);
    }
}
