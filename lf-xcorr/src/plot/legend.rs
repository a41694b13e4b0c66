//! What stands about the chart: title, key, axes and the bar of colours.

use super::AXES;
use super::marks::{arrow, cut_short, empty};
use super::numbers::{figures, round_below, short};
use super::palette::{INK, colour};
use super::view::View;
use super::{Area, Drawn, words};
use plotters::prelude::*;

/// Letters of the components.
const COMPONENTS: [&str; 3] = ["u", "v", "w"];
const TITLE_PX: i32 = 20;
const TEXT_PX: i32 = 14;
/// Names of axes, and how far above the chart they start where they stand above it.
const NAME_PX: i32 = 16;
const NAME_RISE: i32 = 26;
/// Constant: width of a letter of a sans-serif face, its size as one, on the wide side: whoever shows the picture measures.
const LETTER: f64 = 0.6;
/// Where the heading starts, pixels from the left and the top.
const LEFT: i32 = 20;
const TOP: i32 = 12;
/// Distance between lines of the heading.
const LINE: i32 = 22;
/// Least height of the bar of colours.
pub(super) const BAR_PX: i32 = 130;

/// The lines above the chart.
pub(super) struct Heading {
    title: String,
    lines: Vec<String>,
    key: Vec<(Symbol, String)>,
}

/// What an entry of the key shows.
enum Symbol {
    /// An arrow so long, pixels; solid or hollow.
    Arrow(f64, bool),
    Empty,
}

impl Symbol {
    fn width(&self) -> i32 {
        match self {
            Self::Arrow(length, _) => length.round() as i32,
            Self::Empty => 16,
        }
    }
}

impl Heading {
    pub fn new(view: &View) -> Self {
        let layout = &view.field.layout;
        let (quantity, unit) = view.quantity();
        let axis = AXES[view.through];
        let place = layout.origin_mm[view.through] + view.layer as f64 * layout.spacing_mm[view.through];
        let [low, high] = layout.bounds_mm(view.through);
        let place = short(place, high - low);
        let (number, layers) = (view.layer + 1, layout.shape[view.through]);
        let title = format!("{quantity} at {axis} = {place} mm (layer {number} of {layers})");

        let [a, b] = view.across.map(|axis| COMPONENTS[axis]);
        let component = COMPONENTS[view.through];
        let [measured, replaced, no_data] = view.counts();
        let mut lines = vec![
            format!("colour: {component}, through the plane; arrows: {a} and {b}, in the plane"),
            format!("this layer: {measured} measured, {replaced} replaced, {no_data} no data"),
        ];
        let mut notes = Vec::new();
        if let Some((axis, factor)) = view.stretched {
            notes.push(format!("{} stretched {} times, arrows not", AXES[axis], figures(factor)));
        }
        let stride = view.arrow_stride();
        if stride != [1, 1] {
            notes.push(format!("one arrow for {} x {} vectors", stride[0], stride[1]));
        }
        let stride = view.cell_stride();
        if stride != [1, 1] {
            notes.push(format!("one cell for {} x {}", stride[0], stride[1]));
        }
        match cut_short(view) {
            0 => {}
            1 => notes.push("one arrow cut short".into()),
            number => notes.push(format!("{number} arrows cut short")),
        }
        if !notes.is_empty() {
            lines.push(notes.join("; "));
        }

        let [usual_px, scale] = view.arrow_px();
        let mut key = Vec::new();
        if scale > 0.0 {
            let length = round_below(usual_px.max(40.0) / scale);
            key.push((Symbol::Arrow(length * scale, true), format!("{} {unit}", figures(length))));
        }
        if replaced > 0 {
            key.push((Symbol::Arrow(26.0, false), "replaced".into()));
        }
        if no_data > 0 {
            key.push((Symbol::Empty, "no data".into()));
        }
        Self { title, lines, key }
    }

    /// Width and height it takes on the canvas, pixels.
    pub fn size(&self) -> [i32; 2] {
        let key: i32 = self.key.iter().map(|(symbol, text)| symbol.width() + 8 + width(text, TEXT_PX) + 24).sum();
        let lines = self.lines.iter().map(|line| width(line, TEXT_PX));
        let widest = lines.fold(key.max(width(&self.title, TITLE_PX)), i32::max);
        let key_line = i32::from(!self.key.is_empty());
        [LEFT + widest + LEFT, TOP + 28 + LINE * (self.lines.len() as i32 + key_line)]
    }

    pub fn draw(&self, area: &Area) -> Drawn<()> {
        text(area, &self.title, (LEFT, TOP), TITLE_PX)?;
        let mut y = TOP + 30;
        for line in &self.lines {
            text(area, line, (LEFT, y), TEXT_PX)?;
            y += LINE;
        }
        let (mut x, middle) = (LEFT, y + TEXT_PX / 2 - 1);
        for (symbol, name) in &self.key {
            match symbol {
                Symbol::Arrow(length, is_measured) => {
                    let ends = [0.0, *length].map(|length| [x as f64 + length, middle as f64]);
                    arrow(area, ends[0], ends[1], *is_measured)?;
                }
                Symbol::Empty => empty(area, [(x, middle - 8), (x + 16, middle + 8)])?,
            }
            text(area, name, (x + symbol.width() + 8, y), TEXT_PX)?;
            x += symbol.width() + 8 + width(name, TEXT_PX) + 24;
        }
        Ok(())
    }
}

/// Ticks and names of the two axes, and a frame. The chart ends `rest` pixels before the right and lower end of the canvas.
pub(super) fn axes(area: &Area, view: &View, rest: [i32; 2]) -> Drawn<()> {
    let [right, upright] = view.across.map(|axis| view.field.layout.bounds_mm(axis));
    let spans = [right, upright].map(|[low, high]| high - low);
    let ticks = |px: i32| (px / 75).clamp(2, 10) as usize;
    let rows = if view.is_down() { upright[1]..upright[0] } else { upright[0]..upright[1] };
    // The chart's own areas hang on the margins: what is left of the canvas is the chart.
    let mut chart = ChartBuilder::on(area)
        .margin_top(view.corner_px[1])
        .margin_right(rest[0])
        .margin_bottom(rest[1] - 40)
        .x_label_area_size(40)
        .y_label_area_size(view.corner_px[0])
        .build_cartesian_2d(right[0]..right[1], rows)
        .map_err(words)?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_labels(ticks(view.size_px[0]))
        .y_labels(ticks(view.size_px[1]))
        .x_label_formatter(&|value| short(*value, spans[0]))
        .y_label_formatter(&|value| short(*value, spans[1]))
        .label_style(("sans-serif", TEXT_PX))
        .draw()
        .map_err(words)?;
    let [left, top] = view.corner_px;
    let frame = [(left, top), (left + view.size_px[0], top + view.size_px[1])];
    area.draw(&Rectangle::new(frame, INK)).map_err(words)?;
    let [x, y] = view.across.map(|axis| format!("{}, mm", AXES[axis]));
    text(area, &x, (left + view.size_px[0] / 2 - width(&x, NAME_PX) / 2, frame[1].1 + 30), NAME_PX)?;
    text(area, &y, (left - width(&y, NAME_PX) - 4, top - NAME_RISE), NAME_PX)
}

/// The bar of colours with its ticks, to the right of the chart.
pub(super) fn colour_bar(area: &Area, view: &View) -> Drawn<()> {
    let left = view.corner_px[0] + view.size_px[0] + 26;
    let height = view.size_px[1].max(BAR_PX);
    let (top, bottom) = (view.corner_px[1], view.corner_px[1] + height);
    let is_flat = view.limit <= 0.0;
    for y in top..bottom {
        let share = if is_flat { 0.0 } else { 1.0 - 2.0 * (y - top) as f64 / (height - 1) as f64 };
        area.draw(&Rectangle::new([(left, y), (left + 16, y + 1)], colour(share).filled())).map_err(words)?;
    }
    area.draw(&Rectangle::new([(left, top), (left + 16, bottom)], INK)).map_err(words)?;
    let step = if is_flat { 1.0 } else { round_below(view.limit / if height > 250 { 2.0 } else { 1.0 }) };
    let digits = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
    let most = if is_flat { 0 } else { (view.limit / step * (1.0 + 1e-9)).floor() as i64 };
    for tick in -most..=most {
        let value = tick as f64 * step;
        let share = if is_flat { 0.0 } else { value / view.limit };
        let y = top + (0.5 * (1.0 - share) * height as f64).round() as i32;
        area.draw(&PathElement::new(vec![(left + 16, y), (left + 21, y)], INK)).map_err(words)?;
        text(area, &format!("{value:.digits$}"), (left + 25, y - TEXT_PX / 2), TEXT_PX)?;
    }
    let name = format!("{}, {}", COMPONENTS[view.through], view.quantity().1);
    text(area, &name, (left, top - NAME_RISE), NAME_PX)
}

/// A line with its top left corner at a place.
pub(super) fn text(area: &Area, text: &str, place: (i32, i32), size_px: i32) -> Drawn<()> {
    area.draw(&Text::new(text.to_owned(), place, ("sans-serif", size_px).into_font().color(&INK))).map_err(words)
}

fn width(text: &str, size_px: i32) -> i32 {
    (text.chars().count() as f64 * LETTER * size_px as f64).ceil() as i32
}
