//! Departure and residual over the frame, as arrows.

use crate::{Calibrated, ImageLattice};
use glam::DVec2;
use lf_core::statistics::ranked;
use lf_plot::{Anchor, Arrows, Drawing, INK, NAME_PX, TEXT_PX, arrow};

/// Distance between the two charts, their total width, and the longer side of one, px.
const GAP: i32 = 40;
pub(super) const WIDTH: i32 = 1160;
const CHART: i32 = (WIDTH - GAP) / 2;
/// Heights above a chart for its name and its key, and below for the frame's size, px.
const ABOVE: i32 = 56;
const BELOW: i32 = 44;
/// Largest number of arrows along the longer side of the frame; each is the mean of the lenslets around it.
const ARROWS: usize = 28;
/// Share of the arrows that are at most of the usual length.
const USUAL: f64 = 0.9;
/// Smaller usual lengths are rounding, px.
const ROUNDING_PX: f64 = 1e-4;

/// A place in the frame and a vector there, px.
type Vector = ([f64; 2], [f64; 2]);

/// Height of the charts of an image of (rows, columns), px.
pub(super) fn height((rows, columns): (usize, usize)) -> i32 {
    ABOVE + chart_size([columns, rows])[1] + BELOW
}

/// Width and height of a chart of a frame, px.
fn chart_size([columns, rows]: [usize; 2]) -> [i32; 2] {
    let scale = f64::from(CHART) / columns.max(rows) as f64;
    [columns, rows].map(|side| (side as f64 * scale).round().max(40.0) as i32)
}

pub(super) fn draw(
    drawing: &mut Drawing,
    [left, top]: [i32; 2],
    (rows, columns): (usize, usize),
    measured: &ImageLattice,
    calibrated: &Calibrated,
) {
    let kept = || calibrated.residuals.iter().zip(&measured.centres).filter(|(_, centre)| centre.kept);
    let residual: Vec<Vector> = kept().map(|(lenslet, _)| (lenslet.place_px, lenslet.residual_px)).collect();
    let departure: Vec<Vector> = kept().map(|(lenslet, _)| (lenslet.place_px, lenslet.departure_px)).collect();
    let frame = [columns, rows];
    chart(drawing, [left, top], frame, "departure of the lenslets from the perfect lattice", &departure);
    chart(drawing, [left + CHART + GAP, top], frame, "residual: measured minus the camera's", &residual);
}

fn chart(drawing: &mut Drawing, [left, top]: [i32; 2], frame: [usize; 2], name: &str, vectors: &[Vector]) {
    drawing.text(name, (left, top + 8), NAME_PX, Anchor::Left);
    let (size, top) = (chart_size(frame), top + ABOVE);
    drawing.frame([(left, top), (left + size[0], top + size[1])], INK);
    let size_below = top + size[1] + 13;
    drawing.text("0", (left, size_below), TEXT_PX, Anchor::Left);
    let end = format!("x = {} px, y = {} px", frame[0], frame[1]);
    drawing.text(&end, (left + size[0], size_below), TEXT_PX, Anchor::Right);

    let (arrows, lenslets) = means(vectors, frame);
    let key_y = top - 20;
    if arrows.usual <= ROUNDING_PX {
        return drawing.text("none", (left, key_y), TEXT_PX, Anchor::Left);
    }
    // y runs down.
    let per_px = f64::from(size[0]) / frame[0] as f64;
    let px_per_unit = [per_px, -per_px];
    arrows.draw(drawing, px_per_unit, |[x, y]| Some([f64::from(left) + x * per_px, f64::from(top) + y * per_px]));
    if let Some((length, value)) = arrows.sample(px_per_unit) {
        let start = [left, key_y].map(f64::from);
        arrow(drawing, start, [start[0] + length, start[1]], false);
        let each =
            if lenslets < 1.5 { "one lenslet".into() } else { format!("the mean of about {lenslets:.0} lenslets") };
        let text = format!("{value}; an arrow is {each}");
        drawing.text(&text, (left + length as i32 + 10, key_y), TEXT_PX, Anchor::Left);
    }
}

/// Means of vectors over the cells of a grid over the frame, and the mean number of lenslets in a cell that has any.
fn means(vectors: &[Vector], frame: [usize; 2]) -> (Arrows, f64) {
    let longer = frame[0].max(frame[1]) as f64;
    let along = (vectors.len() as f64 * longer / frame[0].min(frame[1]) as f64).sqrt();
    let most = ARROWS.min(along.ceil().max(1.0) as usize);
    let cells = frame.map(|side| ((side as f64 / longer * most as f64).round() as usize).max(1));
    let mut sums = vec![(DVec2::ZERO, DVec2::ZERO, 0.0); cells[0] * cells[1]];
    for (place, vector) in vectors {
        let [i, j] = [0, 1].map(|axis| {
            let share = place[axis] / frame[axis] as f64 * cells[axis] as f64;
            (share.max(0.0) as usize).min(cells[axis] - 1)
        });
        let (places, vectors, count) = &mut sums[j * cells[0] + i];
        *places += DVec2::from(*place);
        *vectors += DVec2::from(*vector);
        *count += 1.0;
    }
    sums.retain(|(.., count)| *count > 0.0);
    let lenslets = vectors.len() as f64 / sums.len().max(1) as f64;
    let vectors: Vec<[f64; 2]> = sums.iter().map(|(_, sum, count)| (*sum / *count).to_array()).collect();
    let mut lengths: Vec<f64> = vectors.iter().map(|[x, y]| x.hypot(*y)).collect();
    let rank = (USUAL * lengths.len() as f64) as usize;
    let arrows = Arrows {
        name: String::new(),
        unit: "px".into(),
        usual: ranked(&mut lengths, rank).unwrap_or(0.0),
        spacing: [frame[0] as f64 / cells[0] as f64; 2],
        is_hollow: false,
        points: sums.iter().map(|(sum, _, count)| (*sum / *count).to_array()).collect(),
        vectors,
    };
    (arrows, lenslets)
}
