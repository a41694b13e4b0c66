//! Image and camera to the voxels that may hold light: dense ray tracing with a multiplicative line of sight.
//!
//! The centre ray of every section of the aperture is traced from every voxel to a pixel. A voxel that held a particle
//! would light all of those pixels, so a voxel is kept where their product (a mean of logarithms, or the least of them)
//! is high enough. Source: Shi, Ding, New & Soria (2017), section 2, after Atkinson & Soria (2009).

mod inline;
mod scattered;
mod sections;

use lf_core::camera::Camera;
use lf_core::footprint::check_depth;
use lf_core::grid::Grid;
use ndarray::ArrayView2;
use rayon::prelude::*;

/// How the pixels of a voxel become its score.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Score {
    /// Geometric mean: forgives a few dark pixels among many.
    Geometric,
    /// The darkest pixel.
    Minimum,
}

/// Which voxels are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// How a voxel is scored.
    pub score: Score,
    /// Least score kept, as a share of the image's brightest pixel.
    pub threshold: f64,
    /// Keep every voxel that can be seen, whatever its score.
    pub keep_all: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { score: Score::Geometric, threshold: DEFAULT_THRESHOLD, keep_all: false }
    }
}

/// The paper gives no threshold. See the README for what this one keeps and loses.
pub const DEFAULT_THRESHOLD: f64 = 0.01;

/// A dark pixel counts as this share of the brightest in a geometric mean, so that one of them costs a voxel a factor
/// of `DARK^(1/sections)` and not everything.
const DARK: f64 = 1e-6;

/// A voxel counts as seen where at least this share of the aperture's sections leads to the sensor.
const SEEN_SHARE: f64 = 0.5;

/// The voxels kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    /// Rising linear indices.
    pub indices: Vec<u64>,
    /// Score of each, counts.
    pub scores: Vec<f32>,
}

/// A slice's voxels as (x + nx y, score), rising.
type Slice = Vec<(u32, f32)>;

/// Scores the voxels of `grid` against an image of the camera's size and keeps those that may hold light.
/// `done` is told how many slices are finished. The work is about `2 n` look-ups a voxel for a square lattice in line
/// with the pixels (n aperture sections a side), and up to `n^2` otherwise.
///
/// # Errors
/// Where the grid is too deep, or a slice has 2^32 voxels or more.
pub fn prune(
    image: ArrayView2<f32>,
    camera: &Camera,
    grid: &Grid,
    options: &Options,
    done: impl Fn(u64) + Sync,
) -> Result<Support, String> {
    check_depth(camera, grid)?;
    let [nx, ny, nz] = grid.shape;
    if nx as u64 * ny as u64 >= 1 << 32 {
        return Err(format!("a slice of {nx} x {ny} voxels is too large"));
    }
    let peak = image.iter().fold(0f32, |peak, value| peak.max(*value));
    if peak <= 0.0 && !options.keep_all {
        return Ok(Support { indices: Vec::new(), scores: Vec::new() });
    }
    let scores = Scores::new(image, peak, options);
    let straight = camera.in_line();
    let slices: Vec<Slice> = (0..nz)
        .into_par_iter()
        .map(|z| {
            let slice = match &straight {
                Some(camera) => inline::slice(&scores, camera, grid, z),
                None => scattered::slice(&scores, camera, grid, z),
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

/// The image as what scores add up or compare, and the rule for keeping.
struct Scores<'a> {
    /// ln(share of the peak) for a geometric mean, share of the peak for a minimum.
    values: Vec<f32>,
    width: usize,
    peak: f32,
    options: &'a Options,
    /// Threshold in terms of `values`.
    least: f32,
}

impl<'a> Scores<'a> {
    fn new(image: ArrayView2<f32>, peak: f32, options: &'a Options) -> Self {
        let peak = if peak > 0.0 { peak } else { 1.0 };
        let geometric = options.score == Score::Geometric;
        let value = |pixel: &f32| {
            let share = f64::from(*pixel) / f64::from(peak);
            (if geometric { share.max(DARK).ln() } else { share }) as f32
        };
        let least = if geometric { options.threshold.max(DARK).ln() } else { options.threshold };
        let (height, width) = image.dim();
        let mut values = Vec::with_capacity(height * width);
        values.extend(image.iter().map(value));
        Self { values, width, peak, options, least: least as f32 }
    }

    fn geometric(&self) -> bool {
        self.options.score == Score::Geometric
    }

    /// A voxel's score in counts if it is kept: `sum` adds up or is the least of the `seen` values out of `sections`.
    #[inline]
    fn keep(&self, sum: f32, seen: u32, sections: u32) -> Option<f32> {
        if f64::from(seen) < SEEN_SHARE * f64::from(sections) {
            return None;
        }
        let mean = if self.geometric() { sum / seen as f32 } else { sum };
        // A score must be above zero even where the threshold is zero.
        if !self.options.keep_all && (mean < self.least || (!self.geometric() && mean <= 0.0)) {
            return None;
        }
        Some(self.peak * if self.geometric() { mean.exp() } else { mean })
    }
}

#[cfg(test)]
mod tests;
