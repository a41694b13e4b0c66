//! What a reconstruction will take, before it is begun.

use crate::kernel::{CutTap, Tap};
use crate::operator::Plane;
use crate::scattered::{self, count_weights};
use crate::tables::RowTap;
use crate::{Method, Options, row_action};
use lf_core::camera::Camera;
use lf_core::grid::Grid;
use lf_core::simd;
use lf_core::weights::{Chords, Footprint, Model};

/// Slices whose profiles are counted.
const SLICES: usize = 9;

/// A voxel's index, its profile, its strength now and one sweep before, its share, and one byte to drop it.
const VOXEL_BYTES: u64 = 8 + 4 + 4 + 4 + 4 + 1;

/// Bytes that [`crate::reconstruct`] will have in use at most, beside image and support themselves: an estimate from
/// a sample of the voxels and slices. Small ones may be exceeded by half.
///
/// # Errors
/// Where the grid is too deep for the camera.
pub fn estimate_bytes(camera: &Camera, grid: &Grid, indices: &[u64], options: &Options) -> Result<u64, String> {
    let footprint = Footprint::new(camera, grid, options.weights, options.basis)?;
    let (width, height) = footprint.sensor();
    let plane = Plane::stride(width) as u64 * height as u64 * 4;
    let voxels = indices.len() as u64;
    Ok(match options.method {
        Method::Mart => {
            let stored = count_weights(&footprint, indices);
            let run = stored as f64 / voxels.max(1) as f64 * row_action::RUN as f64;
            8 * voxels + (stored + 2 * run as u64) * row_action::WEIGHT_BYTES + 4 * plane
        }
        _ if footprint.in_line() => voxels * VOXEL_BYTES + tables(&footprint, indices) + 2 * plane,
        _ => {
            // Kept once they fit into their part: what counts is the least of both.
            let all = count_weights(&footprint, indices) * scattered::WEIGHT_BYTES;
            // Those that are being made, in lists that may have grown to twice their length.
            let run = (all / voxels.max(1)) * voxels.min(scattered::RUN as u64);
            voxels * VOXEL_BYTES
                + all.min(scattered::kept_bytes(options.max_bytes))
                + 2 * run
                + footprint.lookup_bytes()
                + 10 * plane
        }
    })
}

/// How weights are come by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Route {
    /// Products of column and row profiles, made where they are used: the fastest, for lattices in line with the pixels.
    Profiles,
    /// Of each lenslet, looked up.
    Lenslets,
    /// Ray by ray of the aperture's sections, or sphere by sphere.
    Rays,
    /// Made once and stored: what `mart` needs.
    Stored,
}

/// How weights are come by, and whether those of all voxels are kept in memory from the first sweep on.
///
/// # Errors
/// As [`estimate_bytes`].
pub fn route(camera: &Camera, grid: &Grid, indices: &[u64], options: &Options) -> Result<(Route, bool), String> {
    let footprint = Footprint::new(camera, grid, options.weights, options.basis)?;
    if options.method == Method::Mart {
        return Ok((Route::Stored, true));
    }
    if footprint.in_line() {
        return Ok((Route::Profiles, false));
    }
    let bytes = count_weights(&footprint, indices) * scattered::WEIGHT_BYTES;
    let route = if footprint.has_lenslets() { Route::Lenslets } else { Route::Rays };
    Ok((route, bytes <= scattered::kept_bytes(options.max_bytes)))
}

impl Route {
    /// What it is, in words; `camera` and `weights` tell why it is none that is faster.
    pub fn about(self, camera: &Camera, weights: Model, is_kept: bool) -> String {
        let why = match weights {
            Model::Sphere => "the weights are spheres".to_string(),
            _ => camera.misalignment().unwrap_or_else(|| "the lattice is aligned with the pixels".to_string()),
        };
        let kept = if is_kept { "kept in memory" } else { "made anew at every use until those of the voxels held fit" };
        match self {
            Self::Profiles => {
                format!("weights from profiles of columns and rows, by {}, the fastest way: {why}", simd::name())
            }
            Self::Lenslets => format!("weights looked up lenslet by lenslet, {kept}: {why}"),
            Self::Rays => format!("weights ray by ray, the slowest way, {kept}: {why}"),
            Self::Stored => "weights stored, as --method mart needs them".to_string(),
        }
    }
}

/// Profiles of a camera in line: of columns for each x and z of the support, of rows for each y and z, twice while they
/// are brought together.
fn tables(footprint: &Footprint, indices: &[u64]) -> u64 {
    let [nx, ny, nz] = footprint.grid().shape;
    let circle = footprint.circle();
    let run_of_eight = if circle { size_of::<CutTap>() } else { size_of::<Tap>() };
    let row = size_of::<RowTap>() + if circle { size_of::<Chords>() } else { 0 };
    let mut pieces = Vec::new();
    let (mut columns, mut rows) = (0f64, 0f64);
    let slices: Vec<usize> = (0..nz).step_by(nz.div_ceil(SLICES)).collect();
    for &z in &slices {
        pieces.clear();
        footprint.columns(nx / 2, z, &mut pieces);
        // Runs of four that are three quarters full, two to a tap.
        columns += pieces.len() as f64 / 6.0;
        pieces.clear();
        footprint.rows(ny / 2, z, &mut pieces);
        rows += pieces.len() as f64;
    }
    let (columns, rows) = (columns / slices.len() as f64, rows / slices.len() as f64);
    let profiles = (nx as f64 * nz as f64).min(indices.len() as f64);
    let lines = (ny as f64 * nz as f64).min(indices.len() as f64);
    let tables = profiles * (columns * run_of_eight as f64 + 12.0) + lines * (rows * row as f64 + 72.0);
    (2.0 * tables) as u64
}
