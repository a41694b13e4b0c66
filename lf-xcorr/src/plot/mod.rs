//! A picture of a field: the middle slice across z, in-plane arrows coloured by the displacement through the plane.
//!
//! Convention: x to the right, y down, as image rows run. Arrows are drawn larger than the displacement (the title says how
//! much) and centred on the place they were measured at. Replaced vectors are thin with a ring, places without data a cross.

mod palette;

use lf_core::field::{Field, MEASURED, NO_DATA};
use palette::{colour, round_below};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::fmt::Display;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<T> = Result<T, String>;

/// Constant: more arrows than this along an axis of the picture and their heads run together.
const MOST_ARROWS: usize = 48;
/// Length of the chart's longer side, pixels.
const CHART_PX: f64 = 760.0;
/// Room left, right, above and below the chart, pixels.
const ROOM: [i32; 4] = [80, 130, 80, 60];
/// The longest arrow, distances between arrows.
const LONGEST: f64 = 1.0;
/// Narrowest span of the colours, share of the longest displacement: noise on a uniform field is not a pattern.
const NARROWEST: f64 = 0.1;

/// The middle slice of `field` as an SVG.
///
/// # Errors
/// What the drawing library refuses, in its words.
pub fn slice(field: &Field) -> Result<String, String> {
    let slice = Slice::middle(field);
    let scale_px = CHART_PX / slice.extent_mm(0).max(slice.extent_mm(1));
    let size = [0, 1].map(|a| ((slice.extent_mm(a) * scale_px).round() as i32).max(120));
    let canvas = (ROOM[0] + size[0] + ROOM[1], ROOM[2] + size[1] + ROOM[3]);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (canvas.0 as u32, canvas.1 as u32)).into_drawing_area();
        area.fill(&WHITE).map_err(words)?;
        slice.axes(&area, size)?;
        slice.arrows(&area, scale_px)?;
        slice.heading(&area, scale_px)?;
        slice.colour_bar(&area, size)?;
        area.present().map_err(words)?;
    }
    Ok(svg)
}

fn words(error: impl Display) -> String {
    error.to_string()
}

/// One layer of a field, and what is common to its arrows.
struct Slice<'a> {
    field: &'a Field,
    layer: usize,
    /// Every how many vectors an arrow is drawn.
    stride: usize,
    /// Longest in-plane displacement, and longest of all three components, mm.
    longest_mm: [f64; 2],
    /// Lowest and highest displacement through the plane, mm.
    through_mm: [f64; 2],
}

impl<'a> Slice<'a> {
    fn middle(field: &'a Field) -> Self {
        let [nx, ny, nz] = field.layout.shape;
        let layer = nz / 2;
        let (mut longest_mm, mut through_mm) = ([0f64; 2], [f64::INFINITY, f64::NEG_INFINITY]);
        for node in (nx * ny * layer..nx * ny * (layer + 1)).filter(|&node| field.flag[node] != NO_DATA) {
            let [u, v, w] = [field.u[node], field.v[node], field.w[node]].map(f64::from);
            longest_mm = [longest_mm[0].max(u.hypot(v)), longest_mm[1].max(u.hypot(v).hypot(w))];
            through_mm = [through_mm[0].min(w), through_mm[1].max(w)];
        }
        if through_mm[0] > through_mm[1] {
            through_mm = [0.0, 0.0];
        }
        let missing = NARROWEST * longest_mm[1] - (through_mm[1] - through_mm[0]);
        if missing > 0.0 {
            through_mm = [through_mm[0] - 0.5 * missing, through_mm[1] + 0.5 * missing];
        }
        Self { field, layer, stride: nx.max(ny).div_ceil(MOST_ARROWS), longest_mm, through_mm }
    }

    /// Extent along an axis: half a distance between vectors beyond the outermost.
    fn bounds_mm(&self, axis: usize) -> [f64; 2] {
        let layout = &self.field.layout;
        let low = layout.origin_mm[axis] - 0.5 * layout.spacing_mm[axis];
        [low, low + layout.shape[axis] as f64 * layout.spacing_mm[axis]]
    }

    fn extent_mm(&self, axis: usize) -> f64 {
        self.bounds_mm(axis)[1] - self.bounds_mm(axis)[0]
    }

    fn axes(&self, area: &Area, size: [i32; 2]) -> Drawn<()> {
        let [x, y] = [0, 1].map(|axis| self.bounds_mm(axis));
        // The chart's own areas hang on the margins: what is left of the canvas is `size`.
        let ticks = |px: i32| (px / 70).clamp(2, 10) as usize;
        let mut chart = ChartBuilder::on(area)
            .margin_top(ROOM[2])
            .margin_right(ROOM[1])
            .x_label_area_size(ROOM[3])
            .y_label_area_size(ROOM[0])
            .build_cartesian_2d(x[0]..x[1], y[1]..y[0])
            .map_err(words)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .x_desc("x, mm")
            .y_desc("y, mm")
            .x_labels(ticks(size[0]))
            .y_labels(ticks(size[1]))
            .x_label_formatter(&|value| short(*value))
            .y_label_formatter(&|value| short(*value))
            .axis_desc_style(("sans-serif", 17))
            .label_style(("sans-serif", 14))
            .draw()
            .map_err(words)?;
        Ok(())
    }

    /// Pixels of arrow per millimetre of displacement.
    fn arrow_px_per_mm(&self, scale_px: f64) -> f64 {
        let [dx, dy, _] = self.field.layout.spacing_mm;
        if self.longest_mm[0] > 0.0 {
            LONGEST * dx.min(dy) * scale_px * self.stride as f64 / self.longest_mm[0]
        } else {
            0.0
        }
    }

    fn arrows(&self, area: &Area, scale_px: f64) -> Drawn<()> {
        let [nx, ny, _] = self.field.layout.shape;
        let layout = &self.field.layout;
        let arrow_px = self.arrow_px_per_mm(scale_px);
        // Centre the arrows that are drawn between those that are left out.
        let drawn = |n: usize| ((n - 1) % self.stride / 2..n).step_by(self.stride);
        for j in drawn(ny) {
            for i in drawn(nx) {
                let node = i + nx * (j + ny * self.layer);
                let px = |axis: usize, k: usize| (k as f64 + 0.5) * layout.spacing_mm[axis] * scale_px;
                let centre = [ROOM[0] as f64 + px(0, i), ROOM[2] as f64 + px(1, j)];
                if self.field.flag[node] == NO_DATA {
                    cross(area, centre)?;
                    continue;
                }
                let half = [self.field.u[node], self.field.v[node]].map(|mm| 0.5 * mm as f64 * arrow_px);
                let [low, high] = self.through_mm;
                let share = if high > low { (self.field.w[node] as f64 - low) / (high - low) } else { 0.5 };
                let [from, to] = [-1.0, 1.0].map(|sign| [0, 1].map(|a| centre[a] + sign * half[a]));
                arrow(area, from, to, colour(share), self.field.flag[node] == MEASURED)?;
            }
        }
        Ok(())
    }

    /// The title, what is drawn, and an arrow of known length.
    fn heading(&self, area: &Area, scale_px: f64) -> Drawn<()> {
        let layout = &self.field.layout;
        let z = layout.origin_mm[2] + self.layer as f64 * layout.spacing_mm[2];
        let title = format!(
            "Displacement at z = {} mm (layer {} of {}); largest {} mm",
            short(z),
            self.layer + 1,
            layout.shape[2],
            figures(self.longest_mm[1])
        );
        area.draw(&Text::new(title, (ROOM[0], 12), ("sans-serif", 20))).map_err(words)?;
        let arrow_px = self.arrow_px_per_mm(scale_px);
        let mut left = ROOM[0];
        if arrow_px > 0.0 {
            let length_mm =
                round_below(self.longest_mm[0].max(f64::MIN_POSITIVE) * 90.0 / (arrow_px * self.longest_mm[0]));
            let end = left as f64 + length_mm * arrow_px;
            arrow(area, [left as f64, 56.0], [end, 56.0], BLACK, true)?;
            left = end as i32 + 10;
            let key = format!("{} mm in the plane (drawn x {})", figures(length_mm), figures(arrow_px / scale_px));
            left = label(area, left, key)? + 22;
        }
        let [nx, ny, _] = layout.shape;
        let flags = &self.field.flag[nx * ny * self.layer..nx * ny * (self.layer + 1)];
        if flags.iter().any(|&flag| flag != MEASURED && flag != NO_DATA) {
            arrow(area, [left as f64, 56.0], [left as f64 + 26.0, 56.0], BLACK, false)?;
            left = label(area, left + 34, "replaced".into())? + 22;
        }
        if flags.contains(&NO_DATA) {
            cross(area, [left as f64 + 5.0, 56.0])?;
            left = label(area, left + 16, "no data".into())? + 22;
        }
        if self.stride > 1 {
            label(area, left, format!("one vector in {} along x and y", self.stride))?;
        }
        Ok(())
    }

    fn colour_bar(&self, area: &Area, size: [i32; 2]) -> Drawn<()> {
        let left = ROOM[0] + size[0] + 22;
        let (top, bottom) = (ROOM[2], ROOM[2] + size[1]);
        let [low, high] = self.through_mm;
        for y in top..bottom {
            let share = (bottom - y) as f64 / size[1] as f64;
            let share = if high > low { share } else { 0.5 };
            area.draw(&Rectangle::new([(left, y), (left + 16, y + 1)], colour(share).filled())).map_err(words)?;
        }
        area.draw(&Rectangle::new([(left, top), (left + 16, bottom)], BLACK)).map_err(words)?;
        let step = if high > low { round_below((high - low) / 3.0) } else { 1.0 };
        let digits = (-step.log10().floor()).max(0.0) as usize;
        for tick in (low / step).ceil() as i64..=(high / step).floor() as i64 {
            let value = tick as f64 * step;
            let share = if high > low { (value - low) / (high - low) } else { 0.5 };
            let y = bottom - (share * size[1] as f64).round() as i32;
            area.draw(&PathElement::new(vec![(left + 16, y), (left + 21, y)], BLACK)).map_err(words)?;
            area.draw(&Text::new(format!("{value:.digits$}"), (left + 25, y - 6), ("sans-serif", 14)))
                .map_err(words)?;
        }
        area.draw(&Text::new("w, mm", (left, top - 22), ("sans-serif", 17))).map_err(words)
    }
}

/// Draws a line of the key at the height of its symbols; answers where it ends.
fn label(area: &Area, left: i32, text: String) -> Drawn<i32> {
    // Constant: mean width of a sans-serif letter of 14 px. Text is measured by whoever shows the picture.
    let end = left + (text.len() as f64 * 7.2) as i32;
    area.draw(&Text::new(text, (left, 49), ("sans-serif", 14))).map_err(words)?;
    Ok(end)
}

fn arrow(area: &Area, from: [f64; 2], to: [f64; 2], colour: RGBColor, measured: bool) -> Drawn<()> {
    let px = |p: [f64; 2]| (p[0].round() as i32, p[1].round() as i32);
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0].hypot(along[1]);
    let width = if measured { 2 } else { 1 };
    if length >= 1.0 {
        let head = (0.35 * length).clamp(3.0, 10.0).min(length);
        let [x, y] = along.map(|a| a / length * head);
        let neck = [to[0] - x, to[1] - y];
        let barbs = [1.0, -1.0].map(|side| px([neck[0] - side * 0.42 * y, neck[1] + side * 0.42 * x]));
        area.draw(&PathElement::new(vec![px(from), px(if measured { neck } else { to })], colour.stroke_width(width)))
            .map_err(words)?;
        let outline = vec![barbs[0], px(to), barbs[1]];
        if measured {
            area.draw(&Polygon::new(outline, colour.filled())).map_err(words)?;
        } else {
            area.draw(&PathElement::new(outline, colour)).map_err(words)?;
        }
    } else {
        area.draw(&Circle::new(px(from), 2, colour.filled())).map_err(words)?;
    }
    if !measured {
        let middle = [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])];
        area.draw(&Circle::new(px(middle), 4, colour)).map_err(words)?;
    }
    Ok(())
}

fn cross(area: &Area, centre: [f64; 2]) -> Drawn<()> {
    let (x, y) = (centre[0].round() as i32, centre[1].round() as i32);
    let grey = RGBColor(150, 150, 150);
    for stroke in [vec![(x - 3, y - 3), (x + 3, y + 3)], vec![(x - 3, y + 3), (x + 3, y - 3)]] {
        area.draw(&PathElement::new(stroke, grey)).map_err(words)?;
    }
    Ok(())
}

/// A coordinate without tails like 0.30000000000000004.
fn short(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

/// Three significant figures.
fn figures(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let digits = (2 - value.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.digits$}");
    if digits > 0 { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}
