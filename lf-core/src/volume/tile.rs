//! A tile of a volume, cut in x and y, so that a frame too large for one machine is reconstructed on several.
//!
//! The grid is cut into `of` blocks, the cores, numbered along x first, then along y. A tile is responsible for the
//! voxels of its core. It holds more voxels, because a voxel is reconstructed correctly only if all light on its pixels
//! is explained by voxels that are present:
//!
//! - The **pixels** of a tile are those that its core, widened by `halo_mm`, lights in focus. It ignores all others.
//! - The **voxels** of a tile are all those whose light can reach one of its pixels: in focus the core and its halo,
//!   out of focus more, by the width of the beam.
//! - At an edge of the grid there is no halo, and the pixels extend to the end of the sensor, as for the whole volume.
//!
//! In a `.lfv` a tile is the header key `tile`: `{"index", "of", "halo_mm", "core_vox", "pixels"}`. The last two are
//! `[[x0, x1], [y0, y1]]`, half-open ranges of voxels, and of columns and rows of the image. The grid and the indices
//! are those of the whole volume.

use crate::{
    Error, Refusal, Result, camera::Camera, frame::runs_back, grid::Grid, optics::Optics, volume::reach::Reach,
    volume::reader::Volume,
};
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
    /// Width by which the core is extended, mm at the focal plane.
    pub halo_mm: f64,
    /// Voxels of the core along x and y, `[from, to)`.
    pub core_vox: [[usize; 2]; 2],
    /// Columns and rows of the image that the tile uses, `[from, to)`.
    pub pixels: [[usize; 2]; 2],
}

/// The key of a `.lfv` header.
pub const KEY: &str = "tile";
/// Largest number of tiles. More would have a few voxels each, and a command line could not hold their names.
pub const MOST_TILES: usize = 10_000;

/// Width of the usual halo, in beams and in lenslets: see [`Tile::usual_halo_mm`].
const USUAL_BEAMS: f64 = 1.25;
const USUAL_LENSLETS: f64 = 8.0;

/// Number of blocks along x and y: the factors of `of` with the most nearly square blocks, the fewer along x in a tie.
fn blocks(grid: &Grid, of: usize) -> [usize; 2] {
    let unevenness = |along_x: usize| {
        let side = |axis: usize, blocks: usize| grid.shape[axis] as f64 * grid.spacing_mm[axis] / blocks as f64;
        (side(0, along_x) / side(1, of / along_x)).ln().abs()
    };
    let best = (1..=of).filter(|along_x| of.is_multiple_of(*along_x)).min_by(|a, b| {
        let (a, b) = (unevenness(*a), unevenness(*b));
        // Rounding must not decide between equal choices.
        if (a - b).abs() < 1e-9 { std::cmp::Ordering::Equal } else { a.total_cmp(&b) }
    });
    let along_x = best.unwrap_or(1);
    [along_x, of / along_x]
}

/// The voxels along x and y, `[from, to)`, of core `index` of `of` (at most [`MOST_TILES`], a voxel or more each).
pub fn core(grid: &Grid, index: usize, of: usize) -> std::result::Result<[[usize; 2]; 2], Refusal> {
    let wanted = format!("wanted 1/n to n/n, n at most {MOST_TILES}");
    Refusal::unless((1..=of).contains(&index) && of <= MOST_TILES, || format!("{index}/{of}"), wanted)?;
    let blocks = blocks(grid, of);
    let [nx, ny, _] = grid.shape;
    let found = || format!("{} x {} tiles", blocks[0], blocks[1]);
    let wanted = format!("wanted blocks of a voxel or more of {nx} x {ny}");
    Refusal::unless(blocks[0] <= nx && blocks[1] <= ny, found, wanted)?;
    let place = [(index - 1) % blocks[0], (index - 1) / blocks[0]];
    Ok([0, 1].map(|axis| [0, 1].map(|end| (place[axis] + end) * grid.shape[axis] / blocks[axis])))
}

impl Tile {
    /// Tile `index` of `of` of a grid.
    pub fn new(
        camera: &Camera,
        grid: &Grid,
        index: usize,
        of: usize,
        halo_mm: f64,
    ) -> std::result::Result<Self, Refusal> {
        let core_vox = core(grid, index, of)?;
        let pixels = [0, 1].map(|axis| {
            let limit = Optics::new(camera).sensor_px[axis];
            let [from, to] = core_vox[axis];
            let [low, high] = Reach::new(camera, grid, axis)
                .pixels(grid.centre_mm(axis, from) - halo_mm, grid.centre_mm(axis, to - 1) + halo_mm);
            let (is_first, is_last) = (from == 0, to == grid.shape[axis]);
            // The first voxels light the first pixels, or the last ones if the pixels run back.
            let [at_start, at_end] = if runs_back(axis) { [is_last, is_first] } else { [is_first, is_last] };
            [if at_start { 0 } else { low }, if at_end { limit } else { high }]
        });
        Ok(Self { index, of, halo_mm, core_vox, pixels })
    }

    /// A halo for 20 sweeps of lf-mart's default method, mm at the focal plane: 1.25 times the widest beam, plus the
    /// eight lenslets within which lf-mart looks for the strongest voxel. Error at a core's edge, over the brightest
    /// voxel: below 1e-4; below 1e-3 with one beam width, below 6e-3 with half (scene `demo` in four tiles).
    pub fn usual_halo_mm(camera: &Camera, grid: &Grid) -> f64 {
        let optics = Optics::new(camera);
        let ends = [0, grid.shape[2] - 1].map(|z| grid.centre_mm(2, z));
        let beam = |z_mm: f64| 2.0 * (optics.alpha(z_mm) / optics.beta(z_mm)).abs() * optics.half_aperture_mm;
        let pitch = camera.microlenses.pitch_mm / camera.main_lens.magnification;
        USUAL_BEAMS * beam(ends[0]).max(beam(ends[1])) + USUAL_LENSLETS * pitch
    }

    /// The voxels along x and y that the tile holds, for each slice of the grid.
    pub fn held(&self, camera: &Camera, grid: &Grid) -> Vec<[Range<usize>; 2]> {
        let reach = [0, 1].map(|axis| Reach::new(camera, grid, axis));
        let held = |axis: usize, z: usize| {
            let [from, to] = self.core_vox[axis];
            let lit = reach[axis].voxels(self.pixels[axis], grid.centre_mm(2, z));
            lit.start.min(from)..lit.end.max(to)
        };
        (0..grid.shape[2]).map(|z| [held(0, z), held(1, z)]).collect()
    }

    /// Whether a voxel belongs to the core.
    #[inline]
    pub fn owns(&self, [x, y, _]: [usize; 3]) -> bool {
        let [[x0, x1], [y0, y1]] = self.core_vox;
        (x0..x1).contains(&x) && (y0..y1).contains(&y)
    }

    /// The tile as a header key of a `.lfv`.
    pub fn header(&self) -> Map<String, Value> {
        Map::from_iter([(KEY.into(), json!(self))])
    }

    /// The tile in the header of a volume; None for a whole volume. Refuses a tile of another grid.
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
