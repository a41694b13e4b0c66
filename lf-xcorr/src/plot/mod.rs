//! A picture of a field: one layer of it, across any axis.
//!
//! Cells are coloured by the component through the plane, blue to red about 0; one scale for all components and layers, so
//! that a component without displacement is pale. The scale ends where 98 % of the vectors do. Dark arrows are the components in the plane, centred on the place they
//! were measured at and drawn larger than the displacement (the key says how much); replaced vectors are hollow, cells
//! without data grey with a cross. Velocities, mm/s, are drawn where the time between the volumes is known.
//!
//! Convention: x to the right or, across x, y; upright y runs down, as image rows do, and z up.

mod legend;
mod marks;
mod numbers;
mod palette;
mod view;

use legend::{BAR_PX, Heading};
use lf_core::Refusal;
use lf_core::field::{Cut, Field};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::fmt::Display;
use view::View;

/// The letters of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<T> = Result<T, String>;

/// Room left of the chart, right of it and below, pixels.
const ROOM: [i32; 3] = [84, 130, 58];
/// Room between heading and chart, which holds the names of the upright axis and of the bar of colours.
const GAP: i32 = 40;

/// The layer of `field` nearest to `cut` as an SVG.
///
/// # Errors
/// What was found and what was wanted: a place outside the field, or what the drawing library refuses, in its words.
///
/// # Panics
/// Where the axis of `cut` is none.
pub fn slice(field: &Field, cut: Cut) -> Result<String, Refusal> {
    draw(View::new(field, cut)?).map_err(|error| Refusal::new(error, "wanted a picture"))
}

fn draw(mut view: View) -> Drawn<String> {
    let heading = Heading::new(&view);
    let [width, height] = heading.size();
    view.corner_px = [ROOM[0], height + GAP];
    let chart_end = [0, 1].map(|a| view.corner_px[a] + view.size_px[a]);
    let bar_end = view.corner_px[1] + BAR_PX + 12;
    let canvas = [width.max(chart_end[0] + ROOM[1]), bar_end.max(chart_end[1] + ROOM[2])];
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (canvas[0] as u32, canvas[1] as u32)).into_drawing_area();
        area.fill(&WHITE).map_err(words)?;
        marks::cells(&area, &view)?;
        legend::axes(&area, &view, [canvas[0] - chart_end[0], canvas[1] - chart_end[1]])?;
        marks::arrows(&area, &view)?;
        heading.draw(&area)?;
        legend::colour_bar(&area, &view)?;
        area.present().map_err(words)?;
    }
    Ok(svg)
}

fn words(error: impl Display) -> String {
    error.to_string()
}
