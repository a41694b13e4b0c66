//! Image and camera to the voxels that may hold light: dense ray tracing with a multiplicative line of sight.
//!
//! The centre ray of every section of the aperture is traced from every voxel to a pixel. A voxel that held a particle
//! would light all of those pixels, so a voxel is kept where their product (a mean of logarithms, or the least of them)
//! is high enough. Source: Shi, Ding, New & Soria (2017), section 2, after Atkinson & Soria (2009).

mod cell;
mod inline;
mod lines;
mod memory;
mod route;
mod scattered;
mod sections;
mod threshold;
mod views;

pub use memory::estimate_bytes;
pub use route::Route;
pub use threshold::Automatic;

use lf_core::Refusal;
use lf_core::camera::Camera;
use lf_core::grid::Grid;
use lf_core::weights::{check_depth, sections};
use ndarray::ArrayView2;
use rayon::prelude::*;
use std::ops::Range;
use views::Views;

/// How the pixels of a voxel become its score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Score {
    /// Geometric mean of the pixels over the brightest: forgives a few dark pixels among many.
    Geometric,
    /// The share of the pixels that reach the threshold, of which all but this share must: 0 for the darkest pixel to
    /// decide, more for a low quantile, which some dead or noisy pixels cannot sway.
    Share(f64),
}

/// Which voxels are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// How a voxel is scored.
    pub score: Score,
    /// Least geometric mean kept, or least bright pixel, as a share of the image's brightest.
    pub threshold: f64,
    /// A pixel counts as no darker than this share of the brightest in a geometric mean, so that one of them costs a voxel
    /// a factor of `dark^(1/sections)` and not everything. The noise, where there is one.
    pub dark: f64,
    /// Keep every voxel that can be seen, whatever its score.
    pub keep_all: bool,
    /// Sections of the aperture a side, each a ray a voxel; none for the pixels under a lenslet. Fewer are quicker and keep
    /// more: a voxel has fewer pixels that could speak against it.
    pub sections: Option<usize>,
}

/// What a pixel counts as at least in an image without noise.
pub const DARK: f64 = 1e-6;

/// A voxel counts as seen where at least this share of the aperture's sections leads to the sensor.
const SEEN_SHARE: f64 = 0.5;

/// The voxels kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    /// Rising linear indices.
    pub indices: Vec<u64>,
    /// Score of each: the geometric mean in counts, or the share of pixels.
    pub scores: Vec<f32>,
}

/// Voxels of a slice that are looked at, along x and y.
pub type Part = [Range<usize>; 2];

/// A slice's voxels as (x + nx y, score), rising.
type Slice = Vec<(u32, f32)>;

/// Scores the voxels of `grid` against an image of the camera's size and keeps those that may hold light. A pixel that is
/// NaN is blind: it speaks against no voxel and counts as the brightest in its score.
/// `done` is told how many slices are finished. The work is a few additions a voxel for a square lattice in line with the
/// pixels; for another, one for each section of the aperture and each lenslet that its rays from a line of voxels pass;
/// and with a medium, tilt or gap, up to one ray for each section and voxel.
///
/// # Errors
/// Where the grid is too deep, a slice has 2^32 voxels or more, or sections are not within [`lf_core::weights::SECTIONS`].
pub fn prune(
    image: ArrayView2<f32>,
    camera: &Camera,
    grid: &Grid,
    options: &Options,
    done: impl Fn(u64) + Sync,
) -> Result<Support, Refusal> {
    let [nx, ny, nz] = grid.shape;
    prune_parts(image, camera, grid, &vec![[0..nx, 0..ny]; nz], options, done)
}

/// The same of a part of each slice, which may not be empty: what is kept there, and nowhere else. Scores and indices are
/// those of the whole, to the bit.
///
/// # Errors
/// As [`prune()`].
///
/// # Panics
/// Where there is not one part for each slice, or one reaches out of the grid.
pub fn prune_parts(
    image: ArrayView2<f32>,
    camera: &Camera,
    grid: &Grid,
    parts: &[Part],
    options: &Options,
    done: impl Fn(u64) + Sync,
) -> Result<Support, Refusal> {
    check_depth(camera, grid)?;
    sections(camera, options.sections)?;
    let [nx, ny, nz] = grid.shape;
    if nx as u64 * ny as u64 >= 1 << 32 {
        return Err(Refusal::new(format!("a slice of {nx} x {ny} voxels"), "wanted less than 2^32 voxels a slice"));
    }
    assert_eq!(parts.len(), nz, "a part for each slice");
    assert!(parts.iter().all(|part| part[0].end <= nx && part[1].end <= ny), "parts of the grid");
    let peak = image.iter().fold(0f32, |peak, value| peak.max(*value));
    if peak <= 0.0 && !options.keep_all {
        return Ok(Support { indices: Vec::new(), scores: Vec::new() });
    }
    let levels = Levels::new(image, peak, options);
    let route = Route::of(camera);
    let straight = camera.aligned();
    let views = matches!(route, Route::Lines | Route::Tiles).then(|| Views::new(&levels, camera));
    let slices: Vec<Slice> = (0..nz)
        .into_par_iter()
        .map(|z| {
            let part = &parts[z];
            let slice = match (&straight, &views) {
                (Some(camera), _) => inline::slice(&levels, camera, grid, z, part),
                (None, Some(views)) => lines::slice(&levels, camera, views, grid, z, part),
                (None, None) => scattered::slice(&levels, camera, grid, z, part),
            };
            done(1);
            slice
        })
        .collect();
    let count = slices.iter().map(Vec::len).sum();
    let mut support = Support { indices: Vec::with_capacity(count), scores: Vec::with_capacity(count) };
    for (z, slice) in slices.into_iter().enumerate() {
        let base = nx as u64 * ny as u64 * z as u64;
        support.indices.extend(slice.iter().map(|(place, _)| base + u64::from(*place)));
        support.scores.extend(slice.iter().map(|(_, score)| *score));
    }
    Ok(support)
}

impl Support {
    /// How many of these places lie in a voxel of `grid`, and in how many of those that voxel is not kept.
    pub fn lost(&self, grid: &Grid, places_mm: &[[f64; 3]]) -> (usize, usize) {
        let (mut inside, mut lost) = (0, 0);
        for place in places_mm {
            let voxel = [0, 1, 2].map(|axis| grid.place_vox(axis, place[axis]).round());
            if (0..3).all(|axis| voxel[axis] >= 0.0 && voxel[axis] < grid.shape[axis] as f64) {
                inside += 1;
                let index = grid.index(voxel.map(|step| step as usize));
                lost += usize::from(self.indices.binary_search(&index).is_err());
            }
        }
        (inside, lost)
    }
}

/// The image as whole numbers of at most 0 that scores add up, and the rule for keeping.
struct Levels<'a> {
    /// ln(pixel over the brightest) in parts of 1 / [`Levels::unit`]; or 0 for a pixel that reaches the threshold, else -1.
    values: Vec<i32>,
    width: usize,
    peak: f64,
    options: &'a Options,
    unit: f64,
}

impl<'a> Levels<'a> {
    fn new(image: ArrayView2<f32>, peak: f32, options: &'a Options) -> Self {
        let peak = if peak > 0.0 { f64::from(peak) } else { 1.0 };
        let (height, width) = image.dim();
        // The sum over as many sections as pixels of the lenslet, 512 a side at most, stays within an i32.
        let unit = 512.0;
        let level = |pixel: &f32| {
            let share = f64::from(*pixel) / peak;
            match options.score {
                // A blind pixel speaks against no voxel.
                _ if share.is_nan() => 0,
                Score::Geometric => (share.max(options.dark).ln() * unit).round() as i32,
                Score::Share(_) => -i32::from(share < options.threshold || share <= 0.0),
            }
        };
        let mut values = vec![0; height * width];
        values.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, levels)| {
            for (value, pixel) in levels.iter_mut().zip(image.row(y)) {
                *value = level(pixel);
            }
        });
        Self { values, width, peak, options, unit }
    }

    /// A row of the image; none beside the sensor.
    fn row(&self, row: u32) -> Option<&[i32]> {
        self.values.get(row as usize * self.width..)?.get(..self.width)
    }

    /// The least sum of `seen` levels out of `sections` that a voxel is kept with.
    fn least_sum(&self, seen: u32, sections: u32) -> i32 {
        if f64::from(seen) < SEEN_SHARE * f64::from(sections) {
            return i32::MAX;
        }
        if self.options.keep_all {
            return i32::MIN;
        }
        match self.options.score {
            Score::Geometric => {
                let least = self.options.threshold.max(self.options.dark).ln();
                (least * self.unit * f64::from(seen)).ceil() as i32
            }
            Score::Share(dark) => -((dark * f64::from(seen) + 1e-9).floor() as i32),
        }
    }

    /// A voxel's score by the sum of `seen` levels.
    fn score(&self, sum: i32, seen: u32) -> f32 {
        let mean = f64::from(sum) / f64::from(seen.max(1));
        match self.options.score {
            Score::Geometric => (self.peak * (mean / self.unit).exp()) as f32,
            Score::Share(_) => (1.0 + mean) as f32,
        }
    }
}

#[cfg(test)]
mod tests;
