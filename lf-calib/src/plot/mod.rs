//! A picture of a calibrated lattice: pieces of the white image with the lenslets' centres over it, and over the whole
//! frame what lenslets depart by from the perfect lattice, and what the camera still misses.

mod crops;
mod fields;

use crate::{Calibrated, ImageLattice};
use ndarray::Array2;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::fmt::Display;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<T> = Result<T, String>;

/// What lines and words are drawn in, centres that were kept, and those that were left out.
const INK: RGBColor = RGBColor(25, 25, 35);
const KEPT: RGBColor = RGBColor(0, 150, 90);
const LEFT_OUT: RGBColor = RGBColor(215, 75, 0);
const TITLE_PX: i32 = 20;
const TEXT_PX: i32 = 14;
/// Room at the sides and between what is drawn, canvas pixels.
const ROOM: i32 = 20;
/// Room for the heading.
const HEADING: i32 = 92;

/// The picture as an SVG.
///
/// # Errors
/// What the drawing library refuses, in its words.
pub fn lattice(white: &Array2<f32>, measured: &ImageLattice, calibrated: &Calibrated) -> Result<String, String> {
    let pieces = crops::Crops::new(white, measured.pitch_px);
    let width = pieces.width().max(fields::WIDTH) + 2 * ROOM;
    let charts_top = HEADING + pieces.height() + 3 * ROOM;
    let height = charts_top + fields::height(white.dim()) + ROOM;
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (width as u32, height as u32)).into_drawing_area();
        area.fill(&WHITE).map_err(words)?;
        heading(&area, measured, calibrated)?;
        pieces.draw(&area, [ROOM, HEADING], white, calibrated)?;
        fields::draw(&area, [ROOM, charts_top], white.dim(), measured, calibrated)?;
        area.present().map_err(words)?;
    }
    Ok(svg)
}

fn heading(area: &Area, measured: &ImageLattice, calibrated: &Calibrated) -> Drawn<()> {
    let layout = format!("{:?}", measured.layout).to_lowercase();
    let kept = measured.kept();
    text(
        area,
        &format!("Lenslet images: {layout}, pitch {:.4} px, {kept} lenslets", measured.pitch_px),
        (ROOM, 12),
        TITLE_PX,
    )?;
    let departure = match calibrated.degree {
        0 => "a perfect lattice".to_string(),
        degree => {
            format!("departure of degree {degree}, up to {:.2} px at the frame's corners", calibrated.departure_px)
        }
    };
    text(area, &format!("{departure}; residual {:.4} px RMS", calibrated.residual_rms_px), (ROOM, 40), TEXT_PX)?;
    let out = measured.centres.len() - kept;
    let places = [
        (0, KEPT, format!("the camera's centre, lenslet kept ({kept})")),
        (330, LEFT_OUT, format!("lenslet left out ({out})")),
    ];
    for (x, colour, words) in places {
        cross(area, [f64::from(ROOM + x + 6), 70.0], colour)?;
        text(area, &words, (ROOM + x + 20, 63), TEXT_PX)?;
    }
    Ok(())
}

fn text(area: &Area, text: &str, place: (i32, i32), size_px: i32) -> Drawn<()> {
    area.draw(&Text::new(text.to_owned(), place, ("sans-serif", size_px).into_font().color(&INK))).map_err(words)
}

fn cross(area: &Area, [x, y]: [f64; 2], colour: RGBColor) -> Drawn<()> {
    let (x, y) = (x.round() as i32, y.round() as i32);
    for ends in [[(x - 5, y), (x + 5, y)], [(x, y - 5), (x, y + 5)]] {
        area.draw(&PathElement::new(ends.to_vec(), colour.stroke_width(2))).map_err(words)?;
    }
    Ok(())
}

fn words(error: impl Display) -> String {
    error.to_string()
}
