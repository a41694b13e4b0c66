//! The page: heading, pieces of the white image, fields of arrows.

use super::{crops::Crops, crops::KEPT, crops::LEFT_OUT, fields};
use crate::{Calibrated, ImageLattice};
use lf_plot::{Anchor, Drawing, TEXT_PX};
use ndarray::Array2;

const TITLE_PX: i32 = 20;
/// Margin of the page, and distance between its parts, px.
const MARGIN: i32 = 20;
const HEADING: i32 = 92;

/// Draws the picture.
pub fn lattice(white: &Array2<f32>, measured: &ImageLattice, calibrated: &Calibrated) -> Drawing {
    let pieces = Crops::new(white, measured.pitch_px);
    let fields_top = HEADING + pieces.height() + 3 * MARGIN;
    let size = [pieces.width().max(fields::WIDTH) + 2 * MARGIN, fields_top + fields::height(white.dim()) + MARGIN];
    let mut drawing = Drawing::new("Lenslet images", size);
    heading(&mut drawing, measured, calibrated);
    pieces.draw(&mut drawing, [MARGIN, HEADING], white, calibrated);
    fields::draw(&mut drawing, [MARGIN, fields_top], white.dim(), measured, calibrated);
    drawing
}

fn heading(drawing: &mut Drawing, measured: &ImageLattice, calibrated: &Calibrated) {
    let layout = format!("{:?}", measured.layout).to_lowercase();
    let kept = measured.kept();
    let title = format!("Lenslet images: {layout}, pitch {:.4} px, {kept} lenslets", measured.pitch_px);
    drawing.text(&title, (MARGIN, 20), TITLE_PX, Anchor::Left);
    let departure = match calibrated.degree {
        0 => "a perfect lattice".to_string(),
        degree => {
            format!("departure of degree {degree}, up to {:.2} px at the frame's corners", calibrated.departure_px)
        }
    };
    let fit = format!("{departure}; residual {:.4} px RMS", calibrated.residual_rms_px);
    drawing.text(&fit, (MARGIN, 47), TEXT_PX, Anchor::Left);
    let left_out = measured.centres.len() - kept;
    let key = [
        (0, KEPT, format!("the camera's centre, lenslet kept ({kept})")),
        (330, LEFT_OUT, format!("lenslet left out ({left_out})")),
    ];
    for (x, colour, name) in key {
        drawing.plus((MARGIN + x + 6, 70), colour);
        drawing.text(&name, (MARGIN + x + 20, 70), TEXT_PX, Anchor::Left);
    }
}
