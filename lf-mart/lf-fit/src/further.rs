//! The sensors of further cameras: their images, and where the particles of a tile lie on them.
//!
//! A tile is a rectangle of the first sensor. Its particles fill a column along the first camera's axis, which another
//! camera sees from the side: a strip across its sensor.

use super::joint::Setting;
use super::view::View;
use super::window::Rectangle;
use ndarray::ArrayView2;

/// The image of a further camera and the light that is expected there.
#[derive(Debug)]
pub(super) struct Exposure<'a> {
    pub(super) image: ArrayView2<'a, f32>,
    pub(super) light: Vec<f32>,
}

/// Pixels beside the image of a column, whose edges bend a little.
const BESIDE_PX: f64 = 4.0;
/// Steps of Newton's method towards the place under a pixel, and of the differences for its slopes, mm.
const STEPS: usize = 4;
const STEP_MM: f64 = 0.01;

/// The corners of the column under a rectangle of the first sensor, px, between the setting's depths.
pub(super) fn column(setting: &Setting, low: [f64; 2], high: [f64; 2]) -> Vec<[f64; 3]> {
    let corner = |n: usize| {
        let at = [0, 1].map(|axis| if n >> axis & 1 == 0 { low[axis] } else { high[axis] });
        under(setting, at, setting.depth_mm[n >> 2])
    };
    (0..8).map(corner).collect()
}

/// The place at a depth whose chief ray meets the first sensor at `px`.
fn under(setting: &Setting, px: [f64; 2], z_mm: f64) -> [f64; 3] {
    let chief = |x: f64, y: f64| setting.model.chief_px([x, y, z_mm]);
    let (mut x, mut y) = (0.0, 0.0);
    for _ in 0..STEPS {
        let here = chief(x, y);
        let slope = |there: [f64; 2]| [0, 1].map(|k| (there[k] - here[k]) / STEP_MM);
        let ([a, c], [b, d]) = (slope(chief(x + STEP_MM, y)), slope(chief(x, y + STEP_MM)));
        let (right, down) = (px[0] - here[0], px[1] - here[1]);
        let whole = a * d - b * c;
        x += (d * right - b * down) / whole;
        y += (a * down - c * right) / whole;
    }
    [x, y, z_mm]
}

/// The part of a sensor of `size` columns and rows that particles at places can light, when they move by `slack`
/// pixels.
pub(super) fn lit(view: &View, places: &[[f64; 3]], slack: f64, size: [usize; 2]) -> Rectangle {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut reach = 0f64;
    for place in places {
        let there = view.pose.to_camera(*place);
        let chief = view.model.chief_px(there);
        reach = reach.max(view.model.reach_px(there[2]));
        for axis in 0..2 {
            (low[axis], high[axis]) = (low[axis].min(chief[axis]), high[axis].max(chief[axis]));
        }
    }
    let margin = reach + slack + BESIDE_PX;
    let held = |px: f64, axis: usize| px.clamp(0.0, size[axis] as f64) as usize;
    let low = [0, 1].map(|axis| held((low[axis] - margin).floor(), axis));
    let high = [0, 1].map(|axis| held((high[axis] + margin).ceil(), axis).max(low[axis]));
    [low, high]
}

/// The smallest rectangle around two.
pub(super) fn around(a: Rectangle, b: Rectangle) -> Rectangle {
    let is_empty = |[low, high]: &Rectangle| (0..2).any(|axis| low[axis] >= high[axis]);
    if is_empty(&a) || is_empty(&b) {
        return if is_empty(&a) { b } else { a };
    }
    [[0, 1].map(|axis| a[0][axis].min(b[0][axis])), [0, 1].map(|axis| a[1][axis].max(b[1][axis]))]
}

/// A colour for each tile, such that windows of one colour share no pixel: the first that no earlier tile forbids.
/// `windows` are the rectangles of each tile on all sensors.
pub(super) fn colours(windows: &[Vec<Rectangle>]) -> Vec<usize> {
    let meets = |a: &Rectangle, b: &Rectangle| (0..2).all(|axis| a[0][axis] < b[1][axis] && b[0][axis] < a[1][axis]);
    let mut colours: Vec<usize> = Vec::with_capacity(windows.len());
    for (n, own) in windows.iter().enumerate() {
        let shares = |other: &usize| windows[*other].iter().zip(own).any(|(a, b)| meets(a, b));
        let taken: Vec<usize> = (0..n).filter(shares).map(|other| colours[other]).collect();
        colours.push((0..=n).find(|colour| !taken.contains(colour)).unwrap_or(n));
    }
    colours
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four tiles of a row and a row below: a camera at 90 degrees about y sees all tiles of a row in one strip.
    #[test]
    fn tiles_of_one_colour_share_no_pixel() {
        let window = |x: usize, y: usize| {
            let first = [[100 * x, 100 * y], [100 * x + 120, 100 * y + 120]];
            vec![first, [[0, 100 * y], [500, 100 * y + 120]]]
        };
        let windows: Vec<Vec<Rectangle>> = (0..12).map(|n| window(n % 4, n / 4)).collect();
        assert_eq!(colours(&windows), [0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3]);
        let alone: Vec<Vec<Rectangle>> = windows.iter().map(|window| vec![window[0]]).collect();
        assert_eq!(colours(&alone), [0, 1, 0, 1, 2, 3, 2, 3, 0, 1, 0, 1]);
    }

    #[test]
    fn an_empty_rectangle_adds_nothing() {
        let (empty, full) = ([[5, 0], [5, 9]], [[1, 2], [3, 4]]);
        assert_eq!((around(empty, full), around(full, empty)), (full, full));
        assert_eq!(around(full, [[2, 0], [9, 3]]), [[1, 0], [9, 4]]);
    }
}
