//! Charts that need no more explanation than their titles and axes.
//!
//! A [`Chart`] says what is drawn; [`draw`] finds ranges, ticks, keys and room. Series differ in colour and in marker, so
//! that they survive grey print. Points that are not finite are left out.
//!
//! Convention: what a name means stands in the key above its panel; y runs upwards unless its range says otherwise.

mod arrows;
mod chart;
mod clip;
mod extent;
mod key;
mod labels;
mod map;
mod marks;
mod page;
mod palette;
mod panel;
mod scale;
mod text;
mod view;

pub use chart::{Axis, Chart, Mark, Panel, Place, Style};

use crate::Refusal;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::fmt::Display;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<T> = Result<T, String>;

/// The chart as an SVG. One chart has one sequence of bytes.
///
/// # Errors
/// What was found and what was wanted: lists of a mark whose lengths differ, a range that is none, or what the drawing
/// library refuses, in its words.
pub fn draw(chart: &Chart) -> Result<String, Refusal> {
    chart.check()?;
    page::draw(chart).map_err(|error| Refusal::new(error, "wanted a picture"))
}

fn words(error: impl Display) -> String {
    error.to_string()
}
