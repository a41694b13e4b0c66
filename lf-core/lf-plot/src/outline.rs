//! The outlines of shapes and letters, for pictures that are not SVG.

use super::drawing::{Geometry, TextLine};
use super::font::Font;
use super::text::{Anchor, letter_px};
use tiny_skia::{Path, PathBuilder, Transform};

/// The outline of a shape, px. None if there is nothing to draw.
pub(super) fn outline(geometry: &Geometry, font: &Font) -> Option<Path> {
    let mut path = PathBuilder::new();
    let places = match geometry {
        Geometry::Rectangle([(x, y), (right, low)]) => &[(*x, *y), (*right, *y), (*right, *low), (*x, *low)],
        Geometry::Line(places) | Geometry::Polygon(places) => &places[..],
        Geometry::Circle((x, y), radius) => {
            path.push_circle(*x as f32, *y as f32, *radius as f32);
            return path.finish();
        }
        Geometry::Text(line) => return letters(line, font),
    };
    for (n, (x, y)) in places.iter().enumerate() {
        if n == 0 { path.move_to(*x as f32, *y as f32) } else { path.line_to(*x as f32, *y as f32) }
    }
    if !matches!(geometry, Geometry::Line(_)) {
        path.close();
    }
    path.finish()
}

/// The outlines of a line of text. The base line is half an x-height below its place.
fn letters(line: &TextLine, font: &Font) -> Option<Path> {
    let before = match line.anchor {
        Anchor::Left => 0.0,
        Anchor::Middle => 0.5,
        Anchor::Right => 1.0,
    };
    let size = letter_px(line.size_px) as f32;
    let (x, y) = (line.place.0 as f32, line.place.1 as f32);
    let turn = if line.is_upright { -90.0 } else { 0.0 };
    let moved = Transform::from_translate(-before * font.width(&line.text), 0.5 * font.x_height())
        .post_scale(size, size)
        .post_concat(Transform::from_rotate(turn))
        .post_translate(x, y);
    font.outline(&line.text)?.transform(moved)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line of text is as wide upright as it is high level, and its anchor is at its place.
    #[test]
    fn texts_stand_at_their_places() {
        let font = Font::new().unwrap();
        let bounds = |anchor: Anchor, is_upright: bool| {
            let line = TextLine { text: "a < b".into(), place: (40, 60), size_px: 20, anchor, is_upright };
            outline(&Geometry::Text(line), &font).unwrap().bounds()
        };
        let [left, middle, right] = [Anchor::Left, Anchor::Middle, Anchor::Right].map(|anchor| bounds(anchor, false));
        assert!((left.left() - 40.0).abs() < 2.0 && (right.right() - 40.0).abs() < 2.0, "{left:?} {right:?}");
        assert!((0.5 * (middle.left() + middle.right()) - 40.0).abs() < 1.0 && middle.width() > 40.0, "{middle:?}");
        let upright = bounds(Anchor::Middle, true);
        assert!((upright.height() - middle.width()).abs() < 1e-3, "{upright:?}");
        assert!((0.5 * (upright.top() + upright.bottom()) - 60.0).abs() < 1.0, "{upright:?}");
    }
}
