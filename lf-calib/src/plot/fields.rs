//! Departure and residual over the frame, as arrows.

use super::{Area, Drawn, INK, ROOM, TEXT_PX, text, words};
use crate::{Calibrated, ImageLattice};
use plotters::prelude::*;

/// Width of both charts, canvas pixels, and of one.
pub(super) const WIDTH: i32 = 1160;
const CHART: i32 = (WIDTH - 2 * ROOM) / 2;
/// Room above a chart for its name and its key, and below for the axis.
const ABOVE: i32 = 56;
const BELOW: i32 = 44;
/// Arrows along the frame's longer side, at most; each is the mean of the lenslets around it.
const ARROWS: usize = 28;
/// The usual arrow, the length of this share of them, is drawn as long as this share of the distance between arrows.
const USUAL: f64 = 0.9;
const LENGTH: f64 = 0.9;

/// A place in the frame and a vector there, px.
type At = ([f64; 2], [f64; 2]);

/// Height of the charts of an image of (rows, columns).
pub(super) fn height((rows, columns): (usize, usize)) -> i32 {
    ABOVE + chart([columns, rows])[1] + BELOW
}

/// Width and height of a chart of a frame.
fn chart([columns, rows]: [usize; 2]) -> [i32; 2] {
    let scale = f64::from(CHART) / columns.max(rows) as f64;
    [columns, rows].map(|side| (side as f64 * scale).round().max(40.0) as i32)
}

pub(super) fn draw(
    area: &Area,
    [left, top]: [i32; 2],
    (rows, columns): (usize, usize),
    measured: &ImageLattice,
    calibrated: &Calibrated,
) -> Drawn<()> {
    let of = |vector: &dyn Fn(usize) -> [f64; 2]| -> Vec<At> {
        let kept = (0..measured.centres.len()).filter(|n| measured.centres[*n].kept);
        kept.map(|n| (calibrated.residuals[n].place_px, vector(n))).collect()
    };
    let residual = of(&|n| calibrated.residuals[n].residual_px);
    let departure = of(&|n| calibrated.residuals[n].departure_px);
    let frame = [columns, rows];
    field(area, [left, top], frame, "departure of the lenslets from the perfect lattice", &departure)?;
    field(area, [left + CHART + 2 * ROOM, top], frame, "residual: measured less the camera's", &residual)
}

fn field(area: &Area, [left, top]: [i32; 2], frame: [usize; 2], name: &str, vectors: &[At]) -> Drawn<()> {
    let size = chart(frame);
    let top = top + ABOVE;
    area.draw(&Rectangle::new([(left, top), (left + size[0], top + size[1])], INK)).map_err(words)?;
    let (means, cells, each) = means(vectors, frame);
    let mut lengths: Vec<f64> = means.iter().map(|(_, vector)| vector[0].hypot(vector[1])).collect();
    lengths.sort_by(f64::total_cmp);
    let usual = lengths.get((USUAL * lengths.len() as f64) as usize).copied().unwrap_or(0.0);
    let per_px = f64::from(size[0]) / frame[0] as f64;
    let step = f64::from(size[0]) / cells[0] as f64;
    text(area, name, (left, top - ABOVE), TEXT_PX + 2)?;
    // Less than a ten-thousandth of a pixel is arithmetic.
    if usual > 1e-4 {
        let scale = LENGTH * step / usual;
        for (place, vector) in &means {
            let middle = [f64::from(left) + place[0] * per_px, f64::from(top) + place[1] * per_px];
            let reach = (vector[0].hypot(vector[1]) * scale / (2.0 * step)).max(1.0);
            arrow(area, middle, vector.map(|along| along * scale / reach))?;
        }
        let key = round_below(48.0 / scale);
        let length = key * scale;
        arrow(area, [f64::from(left) + 0.5 * length, f64::from(top - 20)], [length, 0.0])?;
        let lenslets =
            if each < 1.5 { "one lenslet".to_string() } else { format!("the mean of some {each:.0} lenslets") };
        text(area, &format!("{key} px; an arrow is {lenslets}"), (left + length as i32 + 10, top - 28), TEXT_PX)?;
    } else {
        text(area, "none", (left, top - 28), TEXT_PX)?;
    }
    text(area, "0", (left, top + size[1] + 6), TEXT_PX)?;
    let end = format!("x = {} px, y = {} px", frame[0], frame[1]);
    text(area, &end, (left + size[0] - 8 * end.len() as i32, top + size[1] + 6), TEXT_PX)
}

/// Means over cells of the frame, where there is something; how many cells, and lenslets to a cell.
fn means(vectors: &[At], frame: [usize; 2]) -> (Vec<At>, [usize; 2], f64) {
    let longer = frame[0].max(frame[1]) as f64;
    let fewest = (vectors.len() as f64 * longer / frame[0].min(frame[1]) as f64).sqrt();
    let along = ARROWS.min(fewest.ceil().max(1.0) as usize);
    let cells = frame.map(|side| ((side as f64 / longer * along as f64).round() as usize).max(1));
    let mut sums = vec![([0.0; 2], [0.0; 2], 0.0); cells[0] * cells[1]];
    for (place, vector) in vectors {
        let [i, j] = [0, 1].map(|axis| {
            let share = place[axis] / frame[axis] as f64 * cells[axis] as f64;
            (share.max(0.0) as usize).min(cells[axis] - 1)
        });
        let sum = &mut sums[j * cells[0] + i];
        for axis in 0..2 {
            sum.0[axis] += place[axis];
            sum.1[axis] += vector[axis];
        }
        sum.2 += 1.0;
    }
    let filled: Vec<_> = sums.iter().filter(|sum| sum.2 > 0.0).collect();
    let each = vectors.len() as f64 / filled.len().max(1) as f64;
    (filled.iter().map(|sum| (sum.0.map(|v| v / sum.2), sum.1.map(|v| v / sum.2))).collect(), cells, each)
}

fn arrow(area: &Area, middle: [f64; 2], vector: [f64; 2]) -> Drawn<()> {
    let length = vector[0].hypot(vector[1]);
    let rounded = |[x, y]: [f64; 2]| (x.round() as i32, y.round() as i32);
    if length < 2.0 {
        return area.draw(&Circle::new(rounded(middle), 1, INK.filled())).map_err(words);
    }
    let [x, y] = vector.map(|along| along / length);
    let point = |ahead: f64, side: f64| rounded([middle[0] + ahead * x - side * y, middle[1] + ahead * y + side * x]);
    let head = (0.4 * length).clamp(3.0, 9.0).min(length);
    let back = 0.5 * length - head;
    area.draw(&PathElement::new(vec![point(-0.5 * length, 0.0), point(back, 0.0)], INK.stroke_width(1)))
        .map_err(words)?;
    let tip = vec![point(back, 0.45 * head), point(0.5 * length, 0.0), point(back, -0.45 * head)];
    area.draw(&Polygon::new(tip, INK.filled())).map_err(words)
}

/// The number 1, 2 or 5 times a power of ten that is nearest to `value` from below.
fn round_below(value: f64) -> f64 {
    let power = value.log10().floor() as i32;
    let digit = [5.0, 2.0, 1.0].into_iter().find(|digit| digit * 10f64.powi(power) <= value).unwrap_or(1.0);
    // Divided where the power is negative, so that it prints without a tail.
    if power < 0 { digit / 10f64.powi(-power) } else { digit * 10f64.powi(power) }
}
