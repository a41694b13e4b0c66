//! Cuts the first sensor into tiles, and finds the window of each tile on all sensors.
//!
//! The particles of a tile fill a column along the first camera's axis. Another camera sees this column from the side,
//! as a strip across its sensor. Each tile has a colour. On no sensor does a pixel get light from two tiles of one
//! colour: these are fitted at the same time, and the result does not depend on the number of threads.

use crate::cameras::view::{CameraView, Cameras};
use crate::model::window::Rectangle;
use crate::particle::Particle;
use rayon::prelude::*;

/// A rectangle of the first sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Tile {
    /// First and end column and row.
    pub(crate) low: [usize; 2],
    pub(crate) high: [usize; 2],
}

impl Tile {
    /// Whether a tile is this one or a neighbour.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.low[axis] <= other.high[axis] && other.low[axis] <= self.high[axis])
    }
}

/// The tiles of a sensor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tiling {
    /// Columns and rows of the sensor.
    size: [usize; 2],
    /// Columns and rows of tiles.
    count: [usize; 2],
    /// Pixels beyond a tile that its particles may light.
    margin: usize,
}

/// Tiles, their rectangles of each sensor, their colours, and the numbers of their particles.
pub(crate) struct TilePlan {
    pub(crate) tiles: Vec<Tile>,
    pub(crate) windows: Vec<Vec<Rectangle>>,
    pub(crate) members: Vec<Vec<usize>>,
    pub(crate) colours: Vec<usize>,
}

/// Pixels beyond a tile within which a task may move particles of its neighbours.
pub(crate) const SEAM: usize = 32;
/// Pixels beside the image of a column: its edges bend a little.
const BESIDE_PX: f64 = 4.0;
/// Number of steps of Newton's method towards the place under a pixel, and the step of its differences, mm.
const STEPS: usize = 4;
const STEP_MM: f64 = 0.01;

impl Tiling {
    /// Tiles of a sensor on which particles light pixels up to `reach_px` from their chief rays.
    pub(crate) fn new(size: [usize; 2], reach_px: usize) -> Self {
        let margin = reach_px + SEAM;
        Self { size, count: size.map(|side| (side / (2 * margin)).max(1)), margin }
    }

    pub(crate) fn tiles(&self) -> Vec<Tile> {
        let edge = |axis: usize, n: usize| self.size[axis] * n / self.count[axis];
        let tile = |n: usize| {
            let at = [n % self.count[0], n / self.count[0]];
            let low = [0, 1].map(|axis| edge(axis, at[axis]));
            Tile { low, high: [0, 1].map(|axis| edge(axis, at[axis] + 1)) }
        };
        (0..self.count[0] * self.count[1]).map(tile).collect()
    }

    /// The number of the tile that holds a place of the sensor; the nearest for a place beside it.
    fn tile_at(&self, place_px: [f64; 2]) -> usize {
        let at = [0, 1].map(|axis| {
            let held = place_px[axis].clamp(0.0, self.size[axis] as f64 - 1.0) as usize;
            // Tile n begins at pixel size * n / count, rounded down.
            ((held + 1) * self.count[axis] - 1) / self.size[axis]
        });
        at[0] + self.count[0] * at[1]
    }

    /// The number of the tile that holds a particle; the nearest if its chief ray misses the sensor.
    pub(crate) fn tile_of(&self, cameras: &Cameras, particle: &Particle) -> usize {
        self.tile_at(cameras.first().model.chief_px(particle.place_mm))
    }

    /// The numbers of the lit particles of each tile.
    pub(crate) fn members(&self, cameras: &Cameras, particles: &[Particle]) -> Vec<Vec<usize>> {
        let places: Vec<usize> = particles.par_iter().map(|particle| self.tile_of(cameras, particle)).collect();
        let mut members = vec![Vec::new(); self.count[0] * self.count[1]];
        let is_lit = |n: &usize| particles[*n].light != 0.0;
        (0..places.len()).filter(is_lit).for_each(|n| members[places[n]].push(n));
        members
    }

    /// Finds the window of each tile: all pixels that its particles can light.
    pub(crate) fn plan(&self, cameras: &Cameras, particles: &[Particle]) -> TilePlan {
        let tiles = self.tiles();
        let members = self.members(cameras, particles);
        let rectangles = |(tile, members): (&Tile, &Vec<usize>)| {
            let mut window = vec![self.first_rectangle(tile)];
            window.extend(cameras.views[1..].iter().map(|view| {
                let seam = SEAM as f64;
                let (low, high) = (tile.low.map(|low| low as f64 - seam), tile.high.map(|high| high as f64 + seam));
                let strip = lit(view, &column(cameras.first(), low, high), 0.0);
                // Particles that the first camera does not see belong to the nearest tile.
                let places: Vec<[f64; 3]> = members.iter().map(|n| particles[*n].place_mm).collect();
                if places.is_empty() { strip } else { around(strip, lit(view, &places, seam)) }
            }));
            window
        };
        let windows: Vec<Vec<Rectangle>> = tiles.iter().zip(&members).map(rectangles).collect();
        TilePlan { colours: colours(&windows), tiles, windows, members }
    }

    /// The rectangle of the first sensor that holds all pixels that the particles of a tile can light.
    fn first_rectangle(&self, tile: &Tile) -> Rectangle {
        let low = tile.low.map(|low| low.saturating_sub(self.margin));
        [low, [0, 1].map(|axis| (tile.high[axis] + self.margin).min(self.size[axis]))]
    }
}

/// The corners of the column under a rectangle of the first sensor, px, between the camera's depths.
fn column(first: &CameraView, low: [f64; 2], high: [f64; 2]) -> Vec<[f64; 3]> {
    let corner = |n: usize| {
        let at = [0, 1].map(|axis| if n >> axis & 1 == 0 { low[axis] } else { high[axis] });
        under(first, at, first.depth_mm[n >> 2])
    };
    (0..8).map(corner).collect()
}

/// The place at a depth whose chief ray meets the first sensor at `px`.
fn under(first: &CameraView, px: [f64; 2], z_mm: f64) -> [f64; 3] {
    let chief = |x: f64, y: f64| first.model.chief_px([x, y, z_mm]);
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

/// The part of a sensor that particles at these places can light, when they move by up to `slack` pixels.
fn lit(view: &CameraView, places: &[[f64; 3]], slack: f64) -> Rectangle {
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
    let held = |px: f64, axis: usize| px.clamp(0.0, view.size()[axis] as f64) as usize;
    let low = [0, 1].map(|axis| held((low[axis] - margin).floor(), axis));
    let high = [0, 1].map(|axis| held((high[axis] + margin).ceil(), axis).max(low[axis]));
    [low, high]
}

/// The smallest rectangle around two.
fn around(a: Rectangle, b: Rectangle) -> Rectangle {
    let is_empty = |[low, high]: &Rectangle| (0..2).any(|axis| low[axis] >= high[axis]);
    if is_empty(&a) || is_empty(&b) {
        return if is_empty(&a) { b } else { a };
    }
    [[0, 1].map(|axis| a[0][axis].min(b[0][axis])), [0, 1].map(|axis| a[1][axis].max(b[1][axis]))]
}

/// A colour for each tile: the first that no earlier tile with a common pixel has. `windows` are the rectangles of each
/// tile on all sensors.
fn colours(windows: &[Vec<Rectangle>]) -> Vec<usize> {
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
