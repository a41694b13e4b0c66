//! Panels on a page.

use super::chart::{Chart, Mark, Panel};
use super::palette::COLOURS;
use super::panel::{Margins, Prepared};
use super::text::{From, TEXT_PX, TITLE_PX, text, wrap};
use super::view::Looks;
use super::{Area, Drawn, map, words};
use plotters::prelude::*;

/// Room at the edges of the page and between panels, px.
const EDGE: i32 = 20;
const BETWEEN: i32 = 22;
/// Heights of a line of the title and of a note.
const TITLE: i32 = 30;
const NOTE: i32 = 21;
/// Constant: widest and highest frame of a page with one, two and more panels beside each other; together with names and
/// ticks a page is 700 to 1500 px wide.
const FRAMES: [[i32; 2]; 3] = [[640, 400], [440, 300], [370, 260]];

/// The page with all its panels.
///
/// Labels can only be counted by placing them, so a page with some that found no room is drawn again with that note.
pub(super) fn draw(chart: &Chart) -> Drawn<String> {
    let (svg, left_out) = page(chart, 0)?;
    if left_out == 0 { Ok(svg) } else { Ok(page(chart, left_out)?.0) }
}

fn page(chart: &Chart, unlabelled: usize) -> Drawn<(String, usize)> {
    let columns = chart.columns.clamp(1, chart.panels.len().max(1));
    let room = FRAMES[columns.min(FRAMES.len()) - 1];
    let one_for_all = Looks::of(&chart.panels).0.len() <= COLOURS.len();
    let looks = |panel| if one_for_all { Looks::of(&chart.panels) } else { Looks::of([panel]) };
    let panels: Vec<Prepared> = chart.panels.iter().map(|panel| Prepared::new(panel, looks(panel), room)).collect();
    let margins: Vec<Margins> = panels.iter().map(Prepared::margins).collect();
    let rows = panels.len().div_ceil(columns);
    let most = |side: fn(&Margins) -> i32, along: &dyn Fn(usize) -> bool| {
        let some = margins.iter().enumerate().filter(|(n, _)| along(*n));
        some.map(|(_, margins)| side(margins)).max().unwrap_or(0)
    };
    let across: Vec<[i32; 2]> = (0..columns)
        .map(|column| [|m: &Margins| m.left, |m: &Margins| m.right].map(|side| most(side, &|n| n % columns == column)))
        .collect();
    let upright: Vec<[i32; 2]> = (0..rows)
        .map(|row| [|m: &Margins| m.top, |m: &Margins| m.below].map(|side| most(side, &|n| n / columns == row)))
        .collect();
    let width = 2 * EDGE
        + across.iter().map(|[left, right]| left + room[0] + right).sum::<i32>()
        + BETWEEN * (columns as i32 - 1);

    let title = wrap(&chart.title, TITLE_PX, width - 2 * EDGE);
    let notes = chart.notes.iter().cloned().chain(own_notes(chart, unlabelled));
    let notes: Vec<String> = notes.flat_map(|note| wrap(&note, TEXT_PX, width - 2 * EDGE)).collect();
    let heading = EDGE / 2 + TITLE * title.len() as i32 + NOTE * notes.len() as i32 + 14;
    let height = heading
        + upright.iter().map(|[top, below]| top + room[1] + below).sum::<i32>()
        + BETWEEN * (rows as i32 - 1).max(0)
        + EDGE / 2;

    let mut svg = String::new();
    let mut left_out = 0;
    {
        let area = SVGBackend::with_string(&mut svg, (width as u32, height as u32)).into_drawing_area();
        area.fill(&WHITE).map_err(words)?;
        lines(&area, &title, EDGE / 2, TITLE, TITLE_PX)?;
        lines(&area, &notes, EDGE / 2 + TITLE * title.len() as i32, NOTE, TEXT_PX)?;
        let mut top = heading;
        for (row, [above, below]) in upright.iter().enumerate() {
            let mut left = EDGE;
            for (column, [before, after]) in across.iter().enumerate() {
                if let Some(panel) = panels.get(row * columns + column) {
                    left_out += panel.draw(&area, [left + before, top + above])?;
                }
                left += before + room[0] + after + BETWEEN;
            }
            top += above + room[1] + below + BETWEEN;
        }
        area.present().map_err(words)?;
    }
    Ok((svg, left_out))
}

fn lines(area: &Area, lines: &[String], top: i32, apart: i32, size_px: i32) -> Drawn<()> {
    for (n, line) in lines.iter().enumerate() {
        text(area, line, (EDGE, top + apart / 2 + n as i32 * apart), size_px, From::Left)?;
    }
    Ok(())
}

/// What the drawing itself has to admit.
fn own_notes(chart: &Chart, unlabelled: usize) -> Vec<String> {
    let mut notes: Vec<String> = Vec::new();
    for note in chart.panels.iter().flat_map(|panel| &panel.marks).filter_map(map::note) {
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    let points = |count: usize| if count == 1 { "1 point".to_string() } else { format!("{count} points") };
    match chart.panels.iter().map(not_positive).sum() {
        0 => {}
        count => notes.push(format!("{} at or below 0 not shown on a logarithmic axis", points(count))),
    }
    if unlabelled > 0 {
        notes.push(format!("{} without a label for want of room", points(unlabelled)));
    }
    notes
}

/// Points of a panel that only a logarithmic axis leaves out.
fn not_positive(panel: &Panel) -> usize {
    let points = panel.marks.iter().filter_map(|mark| match mark {
        Mark::Line { points, .. } | Mark::Points { points, .. } => Some(points),
        _ => None,
    });
    let is_hidden = |point: &&[f64; 2]| {
        let holds = panel.x.holds(point[0]) && panel.y.holds(point[1]);
        !holds && point.iter().all(|value| value.is_finite())
    };
    points.flatten().filter(is_hidden).count()
}
