//! A drawing as PNG.

use super::drawing::{Drawing, DrawnShape};
use super::{font::Font, outline::outline, palette::Colour};
use lf_core::Refusal;
use lf_core::image::picture_colour;
use tiny_skia::{FillRule, Paint, Pixmap, Stroke, StrokeDash, Transform};

/// Pixels of the PNG to a pixel of the drawing: fine enough for print.
const FINER: f32 = 2.0;

/// The drawing as a PNG.
pub(super) fn png(drawing: &Drawing) -> Result<Vec<u8>, Refusal> {
    let size = drawing.size.map(|side| (FINER * side as f32) as u32);
    let too_large = || Refusal::new(format!("a picture of {} x {} px", size[0], size[1]), "wanted a smaller one");
    let mut pixmap = Pixmap::new(size[0], size[1]).ok_or_else(too_large)?;
    let font = Font::new()?;
    drawing.shapes.iter().for_each(|shape| paint(&mut pixmap, shape, &font));
    let rgb: Vec<u8> = pixmap.pixels().iter().flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    picture_colour(size, &rgb)
}

fn paint(pixmap: &mut Pixmap, shape: &DrawnShape, font: &Font) {
    let Some(path) = outline(&shape.geometry, font) else { return };
    let mut paint = Paint::default();
    let Colour(red, green, blue) = shape.colour;
    paint.set_color_rgba8(red, green, blue, 255);
    let finer = Transform::from_scale(FINER, FINER);
    match shape.stroke {
        None => pixmap.fill_path(&path, &paint, FillRule::Winding, finer, None),
        Some(stroke) => {
            let dash = stroke.dashes.and_then(|dashes| StrokeDash::new(dashes.map(f32::from).to_vec(), 0.0));
            let stroke = Stroke { width: stroke.width_px as f32, dash, ..Stroke::default() };
            pixmap.stroke_path(&path, &paint, &stroke, finer, None);
        }
    }
}
