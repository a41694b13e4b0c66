//! A page of panels under a title.

use super::chart::{Chart, Mark, Panel, check};
use super::drawing::Drawing;
use super::text::{Anchor, TEXT_PX, TITLE_PX, wrap};
use super::{map, palette::COLOURS, panel::PanelLayout, view::Looks, view::distinct};
use lf_core::Refusal;

/// Margin of the page, and distance between panels, px.
const EDGE: i32 = 20;
const BETWEEN: i32 = 22;
/// Heights of a line of the title and of a note, px.
const TITLE: i32 = 30;
const NOTE: i32 = 21;
/// Constant: size of a frame on a page of one, two, and three or more columns, px. With names and ticks a page is 700
/// to 1500 px wide.
const FRAMES: [[i32; 2]; 3] = [[640, 400], [440, 300], [370, 260]];
/// The longer side of a frame that is to scale, px.
const FRAMES_TO_SCALE: [i32; 3] = [760, 440, 370];
/// Smallest width of a page, px: room for its title and notes.
const SMALLEST_WIDTH: i32 = 640;

/// Draws a chart. Refuses lists of different lengths and an empty range.
pub fn draw(chart: &Chart) -> Result<Drawing, Refusal> {
    let columns = chart.columns.clamp(1, chart.panels.len().max(1));
    arrange(chart, columns, columns.min(FRAMES.len()) - 1, SMALLEST_WIDTH)
}

/// Draws each panel of a chart apart and small, without the chart's title and notes: for a page that stacks them where
/// it is narrow. Refuses what [`draw`] refuses.
pub fn draw_apart(chart: &Chart) -> Result<Vec<Drawing>, Refusal> {
    let apart = |panel: &Panel| {
        let (title, notes, panels) = (String::new(), Vec::new(), vec![panel.clone()]);
        arrange(&Chart { title, notes, columns: 1, panels }, 1, FRAMES.len() - 1, 0)
    };
    chart.panels.iter().map(apart).collect()
}

/// Draws panels in columns, with frames of a kind, on a page of at least some width.
fn arrange(chart: &Chart, columns: usize, kind: usize, smallest_width: i32) -> Result<Drawing, Refusal> {
    check(chart)?;

    // Lay out the panels.
    let room = |panel: &Panel| if panel.is_to_scale { [FRAMES_TO_SCALE[kind]; 2] } else { FRAMES[kind] };
    let is_one_key = Looks::of(&chart.panels).0.len() <= COLOURS.len();
    let looks = |panel| if is_one_key { Looks::of(&chart.panels) } else { Looks::of([panel]) };
    let panels: Vec<PanelLayout> =
        chart.panels.iter().map(|panel| PanelLayout::new(panel, looks(panel), room(panel))).collect();

    // A column takes the widths of its widest panel, and a row the heights of its highest.
    let column = |n: usize| largest(panels.iter().skip(n).step_by(columns).map(PanelLayout::widths));
    let across: Vec<[i32; 3]> = (0..columns).map(column).collect();
    let down: Vec<[i32; 3]> = panels.chunks(columns).map(|row| largest(row.iter().map(PanelLayout::heights))).collect();
    let length =
        |sections: &[[i32; 3]]| sections.iter().flatten().sum::<i32>() + BETWEEN * (sections.len() as i32 - 1).max(0);
    let width = (2 * EDGE + length(&across)).max(smallest_width);

    // Title and notes.
    let title = wrap(&chart.title, TITLE_PX, width - 2 * EDGE);
    let notes = chart.notes.iter().cloned().chain(own_notes(chart, &panels));
    let notes: Vec<String> = notes.flat_map(|note| wrap(&note, TEXT_PX, width - 2 * EDGE)).collect();
    let notes_top = EDGE / 2 + TITLE * title.len() as i32;
    let heading = notes_top + NOTE * notes.len() as i32 + 14;

    let mut drawing = Drawing::new(&chart.title, [width, heading + length(&down) + EDGE / 2]);
    lines(&mut drawing, &title, EDGE / 2, TITLE, TITLE_PX);
    lines(&mut drawing, &notes, notes_top, NOTE, TEXT_PX);
    let mut top = heading;
    for (row, panels) in down.iter().zip(panels.chunks(columns)) {
        let mut left = EDGE;
        for (column, panel) in across.iter().zip(panels) {
            panel.draw(&mut drawing, [left + column[0], top + row[0]]);
            left += column.iter().sum::<i32>() + BETWEEN;
        }
        top += row.iter().sum::<i32>() + BETWEEN;
    }
    Ok(drawing)
}

/// The largest of each of three sizes.
fn largest(sizes: impl Iterator<Item = [i32; 3]>) -> [i32; 3] {
    sizes.fold([0; 3], |most, size| [0, 1, 2].map(|n| most[n].max(size[n])))
}

fn lines(drawing: &mut Drawing, lines: &[String], top: i32, height: i32, size_px: i32) {
    for (n, line) in lines.iter().enumerate() {
        drawing.text(line, (EDGE, top + height / 2 + n as i32 * height), size_px, Anchor::Left);
    }
}

/// Notes about everything that is not drawn as asked.
fn own_notes(chart: &Chart, panels: &[PanelLayout]) -> Vec<String> {
    let maps = chart.panels.iter().flat_map(|panel| &panel.marks).filter_map(map::note);
    let mut notes = distinct(maps.chain(panels.iter().filter_map(|panel| panel.note.clone())));
    let arrows = chart.panels.iter().flat_map(|panel| &panel.marks).map(|mark| match mark {
        Mark::Arrows(arrows) => arrows.count_cut_short(),
        _ => 0,
    });
    let counted = |count: usize, one: &str, many: &str, text: &str| match count {
        0 => None,
        1 => Some(format!("{one} {text}")),
        _ => Some(format!("{count} {many} {text}")),
    };
    let hidden = chart.panels.iter().map(not_positive).sum();
    notes.extend(counted(arrows.sum(), "one arrow", "arrows", "cut short"));
    notes.extend(counted(hidden, "1 point", "points", "at or below 0 not shown on a logarithmic axis"));
    notes
}

/// Number of a panel's points that only a logarithmic axis leaves out.
fn not_positive(panel: &Panel) -> usize {
    let points = panel.marks.iter().filter_map(|mark| match mark {
        Mark::Line { points, .. } => Some(points),
        _ => None,
    });
    let is_hidden = |point: &&[f64; 2]| {
        let holds = panel.x.holds(point[0]) && panel.y.holds(point[1]);
        !holds && point.iter().all(|value| value.is_finite())
    };
    points.flatten().filter(is_hidden).count()
}
