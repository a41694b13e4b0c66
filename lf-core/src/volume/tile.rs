//! A part of a volume, cut in x and y, so that a frame too large for one machine is reconstructed on several.
//!
//! The whole grid is cut into `of` blocks, the cores, in rows along x, the rows along y. A tile answers for the voxels of
//! its core and holds more: a reconstruction is sure of a voxel only where every pixel that it goes by is explained by
//! voxels that are there. So a tile names the pixels that it goes by, those that the core widened by `halo_mm` lights at the
//! focal plane, and holds every voxel whose light can reach one of them: in focus the core and its halo, out of focus as
//! much more as the beam is wide. The other pixels are blind to it. Where a core ends with the grid there is no halo, and
//! all pixels count to the end of the sensor, as they do for the whole volume.
//!
//! In a `.lfv` a tile is the header key `tile`: `{"index", "of", "halo_mm", "core_vox", "pixels"}`, the last two as
//! `[[x0, x1], [y0, y1]]`, from the first to before the last; columns and rows of the image. The grid and the indices are
//! those of the whole volume.

use crate::camera::Camera;
use crate::grid::Grid;
use crate::optics::Optics;
use crate::volume::Volume;
use crate::{Error, Refusal, Result};
use glam::DVec2;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::ops::Range;

/// One tile of a volume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tile {
    /// Its number, from 1: along x first, then along y.
    pub index: usize,
    /// How many tiles there are.
    pub of: usize,
    /// How far the core is widened, mm at the focal plane.
    pub halo_mm: f64,
    /// Its own voxels along x and y, `[from, to)`.
    pub core_vox: [[usize; 2]; 2],
    /// Columns and rows of the image that it goes by, `[from, to)`.
    pub pixels: [[usize; 2]; 2],
}

/// The key of a `.lfv` header.
pub const KEY: &str = "tile";

/// More would be tiles of a few voxels, and names that no command line holds.
pub const MOST_TILES: usize = 10_000;

/// A halo's width in beams and in lenslets: see [`Tile::usual_halo_mm`].
const USUAL_BEAMS: f64 = 1.25;
const USUAL_LENSLETS: f64 = 8.0;

/// Voxels that a voxel's image may reach beyond its centre's, whatever it stands for: three standard deviations of a blob.
const BASIS_VOX: f64 = 3.0;

/// Blocks along x and y: of all the products that give `of` the one whose blocks are most nearly square, the fewer along x
/// where two are alike.
fn blocks(grid: &Grid, of: usize) -> [usize; 2] {
    let unevenness = |along_x: usize| {
        let side = |axis: usize, blocks: usize| grid.shape[axis] as f64 * grid.spacing_mm[axis] / blocks as f64;
        (side(0, along_x) / side(1, of / along_x)).ln().abs()
    };
    let best = (1..=of).filter(|along_x| of.is_multiple_of(*along_x)).min_by(|a, b| {
        let (a, b) = (unevenness(*a), unevenness(*b));
        // But for rounding, which may not choose.
        if (a - b).abs() < 1e-9 { std::cmp::Ordering::Equal } else { a.total_cmp(&b) }
    });
    let along_x = best.unwrap_or(1);
    [along_x, of / along_x]
}

/// The voxels along x and y of core `index` of `of`.
///
/// # Errors
/// Where there is no such core: found, and what was wanted.
pub fn core(grid: &Grid, index: usize, of: usize) -> std::result::Result<[[usize; 2]; 2], Refusal> {
    if index == 0 || index > of || of > MOST_TILES {
        return Err(Refusal::new(format!("{index}/{of}"), format!("wanted 1/n to n/n, n at most {MOST_TILES}")));
    }
    let blocks = blocks(grid, of);
    let [nx, ny, _] = grid.shape;
    if blocks[0] > nx || blocks[1] > ny {
        let wanted = format!("wanted blocks of a voxel or more of {nx} x {ny}");
        return Err(Refusal::new(format!("{} x {} tiles", blocks[0], blocks[1]), wanted));
    }
    let place = [(index - 1) % blocks[0], (index - 1) / blocks[0]];
    Ok([0, 1].map(|axis| [0, 1].map(|end| (place[axis] + end) * grid.shape[axis] / blocks[axis])))
}

/// Where light lands on the sensor, seen along one axis.
struct Reach<'a> {
    grid: &'a Grid,
    optics: Optics,
    camera: &'a Camera,
    axis: usize,
    /// Places along the other axis that are looked at, mm: distortion differs from one to the next.
    across_mm: [f64; 3],
}

impl<'a> Reach<'a> {
    fn new(camera: &'a Camera, grid: &'a Grid, axis: usize) -> Self {
        let last = grid.shape[1 - axis] - 1;
        let across_mm = [0, last / 2, last].map(|place| grid.centre_mm(1 - axis, place));
        Self { grid, optics: Optics::new(camera), camera, axis, across_mm }
    }

    /// The least and the greatest place on the sensor, mm, of light from `along_mm` at depth `z_mm` through any of
    /// `apertures`, in parts of its half width. What a ray lands beside its own lenslet's middle is within a pitch.
    fn ends(&self, along_mm: f64, z_mm: f64, apertures: &[DVec2]) -> [f64; 2] {
        let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
        for across_mm in self.across_mm {
            let point = if self.axis == 0 { DVec2::new(along_mm, across_mm) } else { DVec2::new(across_mm, along_mm) };
            for aperture in apertures {
                let aperture_mm = *aperture * self.optics.half_aperture_mm();
                let hit = self.optics.sensor_from_object(point, z_mm, aperture_mm);
                let hit = if self.axis == 0 { hit.x } else { hit.y };
                ends = [ends[0].min(hit), ends[1].max(hit)];
            }
        }
        let pitch = self.camera.microlenses.pitch_mm;
        [ends[0] - pitch, ends[1] + pitch]
    }

    /// Pixels that light from `[from, to]` mm in focus reaches.
    fn pixels(&self, from_mm: f64, to_mm: f64) -> [usize; 2] {
        let sides = [from_mm, to_mm].map(|along| self.ends(along, 0.0, &[DVec2::ZERO]));
        let limit = self.optics.sensor_px()[self.axis] as f64;
        let place = |mm: f64| {
            let place = self.optics.place_px(DVec2::splat(mm));
            if self.axis == 0 { place.x } else { place.y }
        };
        let low = place(sides[0][0].min(sides[1][0])).floor().clamp(0.0, limit);
        let high = place(sides[0][1].max(sides[1][1])).ceil().clamp(0.0, limit);
        [low as usize, high as usize]
    }

    /// Voxels at a depth whose light can reach these pixels. The lens inverts: a place on the sensor falls as x rises.
    fn voxels(&self, pixels: [usize; 2], z_mm: f64) -> Range<usize> {
        const RIM: [DVec2; 9] = [
            DVec2::ZERO,
            DVec2::X,
            DVec2::NEG_X,
            DVec2::Y,
            DVec2::NEG_Y,
            DVec2::ONE,
            DVec2::NEG_ONE,
            DVec2::new(1.0, -1.0),
            DVec2::new(-1.0, 1.0),
        ];
        let half = 0.5 * self.optics.sensor_px()[self.axis] as f64;
        let edge = |pixel: usize| (pixel as f64 - half) * self.optics.pixel_pitch_mm();
        let limit = self.optics.sensor_px()[self.axis];
        // What lands beside the sensor's end is as good as on it.
        let low = if pixels[0] == 0 { f64::NEG_INFINITY } else { edge(pixels[0]) };
        let high = if pixels[1] == limit { f64::INFINITY } else { edge(pixels[1]) };
        let count = self.grid.shape[self.axis];
        let place = |i: f64| self.grid.origin_mm[self.axis] + i * self.grid.spacing_mm[self.axis];
        // The first voxel for which something no longer holds.
        let first = |holds: &dyn Fn(usize) -> bool| {
            let (mut from, mut to) = (0, count);
            while from < to {
                let middle = from + (to - from) / 2;
                if holds(middle) { from = middle + 1 } else { to = middle }
            }
            from
        };
        let is_above = |i: usize| self.ends(place(i as f64 + BASIS_VOX), z_mm, &RIM)[0] > high;
        let not_below = |i: usize| self.ends(place(i as f64 - BASIS_VOX), z_mm, &RIM)[1] >= low;
        first(&is_above)..first(&not_below)
    }
}

impl Tile {
    /// Tile `index` of `of` of a grid.
    ///
    /// # Errors
    /// Where there is no such tile: found, and what was wanted.
    pub fn new(
        camera: &Camera,
        grid: &Grid,
        index: usize,
        of: usize,
        halo_mm: f64,
    ) -> std::result::Result<Self, Refusal> {
        let core_vox = core(grid, index, of)?;
        let pixels = [0, 1].map(|axis| {
            let limit = Optics::new(camera).sensor_px()[axis];
            let [from, to] = core_vox[axis];
            let [low, high] = Reach::new(camera, grid, axis)
                .pixels(grid.centre_mm(axis, from) - halo_mm, grid.centre_mm(axis, to - 1) + halo_mm);
            // The grid begins where the sensor ends.
            let low = if to == grid.shape[axis] { 0 } else { low };
            let high = if from == 0 { limit } else { high };
            [low, high]
        });
        Ok(Self { index, of, halo_mm, core_vox, pixels })
    }

    /// The halo that is wide enough for 20 sweeps of lf-mart's default, mm at the focal plane: the width of the farthest voxel's
    /// beam and a quarter more, and the eight lenslets within which lf-mart looks for the strongest voxel. At the edge of the
    /// core tiles are then within 1e-4 of the whole's brightest voxel, with the beam's width alone within 1e-3, with half of
    /// it within 6e-3 (the scene `demo` in four tiles).
    pub fn usual_halo_mm(camera: &Camera, grid: &Grid) -> f64 {
        let optics = Optics::new(camera);
        let ends = [0, grid.shape[2] - 1].map(|z| grid.centre_mm(2, z));
        let beam = |z_mm: f64| 2.0 * (optics.alpha(z_mm) / optics.beta(z_mm)).abs() * optics.half_aperture_mm();
        let pitch = camera.microlenses.pitch_mm / camera.main_lens.magnification;
        USUAL_BEAMS * beam(ends[0]).max(beam(ends[1])) + USUAL_LENSLETS * pitch
    }

    /// The voxels along x and y that the tile holds in each slice.
    pub fn held(&self, camera: &Camera, grid: &Grid) -> Vec<[Range<usize>; 2]> {
        let reach = [0, 1].map(|axis| Reach::new(camera, grid, axis));
        let held = |z: usize| {
            [0, 1].map(|axis| {
                let [from, to] = self.core_vox[axis];
                let lit = reach[axis].voxels(self.pixels[axis], grid.centre_mm(2, z));
                lit.start.min(from)..lit.end.max(to)
            })
        };
        (0..grid.shape[2]).map(held).collect()
    }

    /// Whether a voxel is of the core.
    #[inline]
    pub fn owns(&self, [x, y, _]: [usize; 3]) -> bool {
        let [[x0, x1], [y0, y1]] = self.core_vox;
        (x0..x1).contains(&x) && (y0..y1).contains(&y)
    }

    /// The header key of a `.lfv`.
    pub fn header(&self) -> Map<String, Value> {
        let mut keys = Map::new();
        keys.insert(KEY.into(), json!(self));
        keys
    }

    /// The tile that a volume is; none for a whole volume.
    ///
    /// # Errors
    /// Where its key is not a tile of its grid.
    pub fn of(volume: &Volume) -> Result<Option<Self>> {
        let Some(value) = volume.extra().get(KEY) else { return Ok(None) };
        let wanted = "wanted that of a tile of its grid, as lf-prune --tile writes it";
        let tile = Self::deserialize(value)
            .map_err(|error| Error::new(volume.name(), format!("`{KEY}` in its header: {error}"), wanted))?;
        if core(volume.grid(), tile.index, tile.of).ok() != Some(tile.core_vox) {
            let found = format!("`{KEY}` in its header is {value}");
            return Err(Error::new(volume.name(), found, wanted));
        }
        Ok(Some(tile))
    }
}
