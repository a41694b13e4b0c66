//! All particles of a frame. The sensor is cut into tiles; a tile's particles are fitted together, the others held.
//!
//! Tiles have four colours. Tiles of one colour are so far apart that no pixel has light of the particles of two: they
//! are fitted at the same time, and the result does not depend on the number of threads. With further cameras there are
//! more colours: no sensor may have light of the particles of two tiles of one.

use super::buffers::Buffers;
use super::further::{self, Exposure};
use super::image::SpotImage;
use super::joint::{Ends, Setting};
use super::window::{Rectangle, Sheet, Window};
use super::{noise, noise::Noise, spot::Spot};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// A rectangle of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tile {
    /// First and end column and row.
    pub(super) low: [usize; 2],
    pub(super) high: [usize; 2],
    colour: usize,
}

impl Tile {
    /// Whether a tile is the same or a neighbour.
    fn meets(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.low[axis] <= other.high[axis] && other.low[axis] <= self.high[axis])
    }
}

/// The numbers of the particles of all tiles, as one tile sees them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Members<'a> {
    pub(super) tiles: &'a [Tile],
    pub(super) lists: &'a [Vec<usize>],
    /// The number of the tile.
    pub(super) own: usize,
}

impl<'a> Members<'a> {
    /// The tile's own.
    pub(super) fn own(&self) -> &'a [usize] {
        &self.lists[self.own]
    }

    /// Its own and those of its neighbours, rising; the flag tells its own.
    pub(super) fn about(&self) -> Vec<(usize, bool)> {
        let mut about = Vec::new();
        for (n, tile) in self.tiles.iter().enumerate() {
            if tile.meets(&self.tiles[self.own]) {
                about.extend(self.lists[n].iter().map(|member| (*member, n == self.own)));
            }
        }
        about.sort_unstable();
        about
    }
}

/// The particles and their light.
#[derive(Debug)]
pub(super) struct Cloud<'a> {
    pub(super) image: ArrayView2<'a, f32>,
    /// Expected counts of each pixel.
    pub(super) light: Vec<f32>,
    /// Images and light of further cameras.
    pub(super) further: Vec<Exposure<'a>>,
    pub(super) spots: Vec<Spot>,
    /// Whether a particle stayed whole when it was tried to be two.
    pub(super) is_whole: Vec<bool>,
    /// Whether a round works on a particle: the last one still moved it, or changed something near it.
    pub(super) is_awake: Vec<bool>,
    /// Pixels of the focal plane within which a change wakes particles.
    pub(super) beside_px: f64,
    /// Most pixels from a particle's chief ray to a pixel that it lights.
    pub(super) reach_px: usize,
}

/// Tiles, their rectangles of each sensor, and their colours.
pub(super) struct Plan {
    pub(super) tiles: Vec<Tile>,
    pub(super) windows: Vec<Vec<Rectangle>>,
    colours: Vec<usize>,
}

impl Plan {
    /// Most tiles that are fitted at the same time.
    pub(super) fn most_of_a_colour(&self) -> usize {
        let count = |colour: &usize| self.colours.iter().filter(|other| *other == colour).count();
        self.colours.iter().map(count).max().unwrap_or(0)
    }
}

/// Pixels beyond a tile within which a task may move particles of its neighbours.
pub(super) const SEAM: usize = 32;
/// Tiles that are rendered before their light is added up; bounds the memory.
pub(super) const AT_ONCE: usize = 16;
/// Most pixels of a camera from which noise is found.
pub(super) const PAIRS: usize = 2_000_000;

/// Columns and rows of tiles. No pixel has light of the particles of two tiles of one colour.
pub(super) fn tile_counts(size: [usize; 2], reach_px: usize) -> [usize; 2] {
    size.map(|side| (side / (2 * (reach_px + SEAM))).max(1))
}

/// The number of the tile, of so many columns and rows, that holds a place of the sensor; the nearest for one beside it.
pub(super) fn tile_at(size: [usize; 2], count: [usize; 2], place_px: [f64; 2]) -> usize {
    let at = [0, 1].map(|axis| {
        let held = place_px[axis].clamp(0.0, size[axis] as f64 - 1.0) as usize;
        // Tile n begins at pixel size * n / count, rounded down.
        ((held + 1) * count[axis] - 1) / size[axis]
    });
    at[0] + count[0] * at[1]
}

impl<'a> Cloud<'a> {
    /// Particles without light on the sensor yet: see [`Cloud::render`].
    pub(super) fn new(image: ArrayView2<'a, f32>, spots: Vec<Spot>, reach_px: usize, beside_px: f64) -> Self {
        let (is_whole, is_awake) = (vec![false; spots.len()], vec![true; spots.len()]);
        let light = vec![0.0; image.len()];
        Self { light, image, further: Vec::new(), spots, is_whole, is_awake, beside_px, reach_px }
    }

    fn size(&self) -> [usize; 2] {
        [self.image.ncols(), self.image.nrows()]
    }

    pub(super) fn tiles(&self) -> Vec<Tile> {
        let count = tile_counts(self.size(), self.reach_px);
        let edge = |axis: usize, n: usize| self.size()[axis] * n / count[axis];
        let tile = |n: usize| {
            let at = [n % count[0], n / count[0]];
            let low = [0, 1].map(|axis| edge(axis, at[axis]));
            let high = [0, 1].map(|axis| edge(axis, at[axis] + 1));
            Tile { low, high, colour: at[0] % 2 + 2 * (at[1] % 2) }
        };
        (0..count[0] * count[1]).map(tile).collect()
    }

    /// The rectangle of the first sensor that holds all pixels that the particles of a tile can light.
    fn first_rectangle(&self, tile: &Tile) -> Rectangle {
        let margin = self.reach_px + SEAM;
        let size = self.size();
        let low = tile.low.map(|low| low.saturating_sub(margin));
        [low, [0, 1].map(|axis| (tile.high[axis] + margin).min(size[axis]))]
    }

    /// The tiles, the windows in which their particles are fitted, and the order.
    pub(super) fn plan(&self, setting: &Setting) -> Plan {
        let tiles = self.tiles();
        let mut windows: Vec<Vec<Rectangle>> = tiles.iter().map(|tile| vec![self.first_rectangle(tile)]).collect();
        if self.further.is_empty() {
            let colours = tiles.iter().map(|tile| tile.colour).collect();
            return Plan { tiles, windows, colours };
        }
        let members = self.members(setting, &tiles);
        for ((tile, members), windows) in tiles.iter().zip(&members).zip(&mut windows) {
            let beside = SEAM as f64;
            let low = tile.low.map(|low| low as f64 - beside);
            let column = further::column(setting, low, tile.high.map(|high| high as f64 + beside));
            // Particles that the first camera does not see count to the nearest tile.
            let places: Vec<[f64; 3]> = members.iter().map(|n| self.spots[*n].place_mm).collect();
            for (view, exposure) in setting.views.iter().zip(&self.further) {
                let size = [exposure.image.ncols(), exposure.image.nrows()];
                let strip = further::lit(view, &column, 0.0, size);
                windows.push(match places.is_empty() {
                    true => strip,
                    false => further::around(strip, further::lit(view, &places, beside, size)),
                });
            }
        }
        Plan { colours: further::colours(&windows), tiles, windows }
    }

    /// The window of a tile: all pixels that its particles can light.
    pub(super) fn window(&self, rectangles: &[Rectangle]) -> Window {
        if self.further.is_empty() {
            let [low, high] = rectangles[0];
            return Window::cut(self.image, &self.light, low, high);
        }
        let sheets: Vec<(Sheet, Rectangle)> = self.sheets().zip(rectangles.iter().copied()).collect();
        Window::cut_all(&sheets)
    }

    /// Puts the light of a window back onto the sensors.
    fn paste(&mut self, window: &Window) {
        let width = self.image.ncols();
        window.paste(0, &mut self.light, width);
        for (n, exposure) in self.further.iter_mut().enumerate() {
            window.paste(n + 1, &mut exposure.light, exposure.image.ncols());
        }
    }

    /// The particles of each tile, by their chief rays.
    pub(super) fn members(&self, setting: &Setting, tiles: &[Tile]) -> Vec<Vec<usize>> {
        let places: Vec<usize> = self.spots.par_iter().map(|spot| self.tile_of(setting, spot)).collect();
        let mut members = vec![Vec::new(); tiles.len()];
        let held = |n: &usize| self.spots[*n].light > 0.0;
        (0..places.len()).filter(held).for_each(|n| members[places[n]].push(n));
        members
    }

    /// The number of the tile that holds a particle; the nearest if its chief ray misses the sensor.
    pub(super) fn tile_of(&self, setting: &Setting, spot: &Spot) -> usize {
        tile_at(self.size(), tile_counts(self.size(), self.reach_px), setting.model.chief_px(spot.place_mm))
    }

    /// Renders all particles anew.
    pub(super) fn render(&mut self, setting: &Setting) {
        self.light.fill(0.0);
        self.further.iter_mut().for_each(|exposure| exposure.light.fill(0.0));
        let plan = self.plan(setting);
        let members = self.members(setting, &plan.tiles);
        let tasks: Vec<(&Vec<Rectangle>, &Vec<usize>)> = plan.windows.iter().zip(&members).collect();
        let width = self.image.ncols();
        for tasks in tasks.chunks(AT_ONCE) {
            let rendered: Vec<Window> = tasks
                .par_iter()
                .map_init(Buffers::default, |buffers, (rectangles, members)| {
                    let mut window = self.window(rectangles);
                    window.light.fill(0.0);
                    for n in *members {
                        let image = setting.image(&self.spots[*n], &window, buffers);
                        image.add_to(&mut window.light, window.columns, 1.0);
                    }
                    window
                })
                .collect();
            for window in &rendered {
                window.add_to(0, &mut self.light, width);
                for (n, exposure) in self.further.iter_mut().enumerate() {
                    window.add_to(n + 1, &mut exposure.light, exposure.image.ncols());
                }
            }
        }
    }

    /// Wakes the particles for which this holds, and lets the others sleep.
    pub(super) fn wake_where(&mut self, is_wanted: impl Fn(&Spot) -> bool) {
        self.is_awake = self.spots.iter().map(is_wanted).collect();
    }

    /// Wakes the particles near places, which are listed by tile.
    pub(super) fn wake_near(&mut self, setting: &Setting, places: &[Vec<[f64; 3]>]) {
        let tiles = self.tiles();
        let members = self.members(setting, &tiles);
        let near = |own: usize| -> Vec<usize> {
            let about = tiles.iter().zip(places).filter(|(tile, _)| tile.meets(&tiles[own]));
            let about: Vec<[f64; 3]> = about.flat_map(|(_, places)| places.iter().copied()).collect();
            let is_near = |n: &usize| {
                about.iter().any(|place| setting.is_beside(self.spots[*n].place_mm, *place, self.beside_px))
            };
            members[own].iter().copied().filter(is_near).collect()
        };
        let woken: Vec<Vec<usize>> = (0..tiles.len()).into_par_iter().map(near).collect();
        woken.into_iter().flatten().for_each(|n| self.is_awake[n] = true);
    }

    /// The tiles in which a particle is awake.
    pub(super) fn tiles_awake(&self, setting: &Setting) -> Vec<bool> {
        let tiles = self.tiles();
        let members = self.members(setting, &tiles);
        members.iter().map(|members| members.iter().any(|n| self.is_awake[*n])).collect()
    }

    /// Runs `work` on the tiles that `wanted` names, colour by colour, and takes the light that it leaves in the
    /// windows. `work` gets a window, its tile and the tile's particles; `done` the number of the tile.
    pub(super) fn each_tile<T: Send>(
        &mut self,
        setting: &Setting,
        wanted: impl Fn(usize) -> bool,
        work: impl Fn(&Self, &mut Window, &Tile, Members, &mut Buffers) -> T + Sync,
        mut done: impl FnMut(&mut Self, usize, T),
    ) {
        let Plan { tiles, windows, colours } = self.plan(setting);
        for colour in 0..=colours.iter().copied().max().unwrap_or(0) {
            let members = self.members(setting, &tiles);
            let mine = |n: &usize| colours[*n] == colour && !members[*n].is_empty() && wanted(*n);
            let tasks: Vec<usize> = (0..tiles.len()).filter(mine).collect();
            for tasks in tasks.chunks(AT_ONCE) {
                let results: Vec<(Window, T)> = tasks
                    .par_iter()
                    .map_init(Buffers::default, |buffers, n| {
                        let mut window = self.window(&windows[*n]);
                        let members = Members { tiles: &tiles, lists: &members, own: *n };
                        let result = work(self, &mut window, &tiles[*n], members, buffers);
                        (window, result)
                    })
                    .collect();
                for (n, (window, result)) in tasks.iter().zip(results) {
                    self.paste(&window);
                    done(self, *n, result);
                }
            }
        }
    }

    /// Fits all particles once. Returns the gain in -2 log L.
    pub(super) fn sweep(&mut self, setting: &Setting, ends: Ends) -> f64 {
        let mut total = 0.0;
        let work = |cloud: &Self, window: &mut Window, _: &Tile, members: Members, buffers: &mut Buffers| {
            let members = members.own();
            let spots: Vec<Spot> = members.iter().map(|n| cloud.spots[*n]).collect();
            let images: Vec<SpotImage> = spots.iter().map(|spot| setting.image(spot, window, buffers)).collect();
            images.iter().for_each(|image| image.add_to(&mut window.light, window.columns, -1.0));
            let before = setting.deviance(window, images.iter(), buffers);
            let ends = Ends { gain: ends.gain * spots.len() as f64, ..ends };
            let fitted = setting.joint(window, &spots, images, ends, buffers);
            fitted.images.iter().for_each(|image| image.add_to(&mut window.light, window.columns, 1.0));
            (before - fitted.deviance, members.to_vec(), fitted.spots)
        };
        self.each_tile(
            setting,
            |_| true,
            work,
            |cloud, _, (gain, members, spots)| {
                total += gain;
                members.iter().zip(spots).for_each(|(n, spot)| cloud.spots[*n] = spot);
            },
        );
        total
    }

    /// Finds light, places held: expectation maximisation, tile by tile.
    pub(super) fn share_light(&mut self, setting: &Setting, rounds: usize) {
        let floor = |noise: &Noise| noise.read_variance.sqrt().max(noise.gain) as f32;
        let floors: Vec<f32> = setting.noises().map(floor).collect();
        let work = |cloud: &Self, window: &mut Window, _: &Tile, members: Members, buffers: &mut Buffers| {
            let members = members.own();
            let mut spots: Vec<Spot> = members.iter().map(|n| cloud.spots[*n]).collect();
            let mut images: Vec<SpotImage> = spots.iter().map(|spot| setting.image(spot, window, buffers)).collect();
            for _ in 0..rounds {
                let ratio = |(n, (seen, light)): (usize, (&f32, &f32))| {
                    let floor = floors[window.camera_of(n)];
                    if seen.is_nan() { 1.0 } else { seen.max(0.0) / (light + floor) }
                };
                let ratios: Vec<f32> = window.seen.iter().zip(&window.light).enumerate().map(ratio).collect();
                for (spot, image) in spots.iter_mut().zip(&mut images) {
                    let (mut sum, mut whole) = (0.0, 0.0);
                    image.pixels(window.columns, |n, pixel| {
                        sum += f64::from(pixel[3] * ratios[n]);
                        whole += f64::from(pixel[3]);
                    });
                    let factor = if whole > 0.0 { (sum / whole).max(1e-6) } else { 1e-6 };
                    spot.light *= factor;
                    image.add_to(&mut window.light, window.columns, factor as f32 - 1.0);
                    image.scale(factor as f32);
                }
            }
            (members.to_vec(), spots)
        };
        self.each_tile(
            setting,
            |_| true,
            work,
            |cloud, _, (members, spots)| {
                members.iter().zip(spots).for_each(|(n, spot)| cloud.spots[*n] = spot);
            },
        );
    }

    /// Expected counts and difference of the lit pixels of a camera; 0 is the first. Rows are as far apart as [`PAIRS`]
    /// asks.
    pub(super) fn pairs(&self, camera: usize) -> Vec<(f32, f32)> {
        let (image, light) = self.sheets().nth(camera).expect("the cloud has this camera");
        let apart = image.len().div_ceil(PAIRS);
        let rows = image.rows().into_iter().zip(light.chunks(image.ncols())).step_by(apart);
        rows.flat_map(|(seen, light)| noise::pairs(seen.into_iter().zip(light))).collect()
    }

    /// Image and light of each camera.
    fn sheets(&self) -> impl Iterator<Item = Sheet<'_>> {
        let further = self.further.iter().map(|exposure| (exposure.image, exposure.light.as_slice()));
        std::iter::once((self.image, self.light.as_slice())).chain(further)
    }

    /// Mean of squared differences over variances where light is expected, each held below 25.
    pub(super) fn misfit(&self, setting: &Setting) -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        for ((image, light), noise) in self.sheets().zip(setting.noises()) {
            let least = 3.0 * noise.gain.max(noise.read_variance.sqrt()) as f32;
            let width = image.ncols();
            let of_row = |row: usize| {
                let (mut sum, mut count) = (0.0, 0usize);
                for (seen, light) in image.row(row).iter().zip(&light[row * width..(row + 1) * width]) {
                    if !seen.is_nan() && *light > least {
                        sum += f64::from(((seen - light).powi(2) / noise.variance(*light)).min(25.0));
                        count += 1;
                    }
                }
                (sum, count)
            };
            // Rows are added up in their order, for the same sum by any number of threads.
            let rows: Vec<(f64, usize)> = (0..image.nrows()).into_par_iter().map(of_row).collect();
            rows.iter().for_each(|(more, pixels)| {
                sum += more;
                count += pixels;
            });
        }
        if count > 0 { sum / count as f64 } else { 1.0 }
    }
}
