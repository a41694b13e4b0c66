//! What pruning will take, before it is begun.

use crate::route::Route;
use crate::sections::Sections;
use crate::{Options, Part, prune_parts};
use lf_core::Refusal;
use lf_core::camera::Camera;
use lf_core::grid::Grid;
use ndarray::ArrayView2;

/// Slices that are pruned to foretell how many voxels all of them keep.
const SLICES: usize = 9;

/// Bytes of a voxel kept: index and score in the support, and what the lists of the slices, which are let go of one by one
/// as the support grows, take at that time. Measured: 13 to 17.
const KEPT_BYTES: f64 = 12.0 + 6.0;

/// Bytes that [`prune_parts`] will have in use at most, beside the image itself, and the voxels that it will keep: an estimate by a
/// few of the slices.
///
/// # Errors
/// As [`prune_parts`].
pub fn estimate_bytes(
    image: ArrayView2<f32>,
    camera: &Camera,
    grid: &Grid,
    parts: &[Part],
    options: &Options,
) -> Result<(u64, u64), Refusal> {
    let nz = grid.shape[2];
    let few = nz.min(SLICES);
    // The same depth in fewer slices.
    let stretch = nz as f64 / few as f64;
    let mut sample = grid.clone();
    sample.shape[2] = few;
    sample.spacing_mm[2] *= stretch;
    sample.origin_mm[2] += 0.5 * (stretch - 1.0) * grid.spacing_mm[2];
    let nearest = |slice: usize| parts[((slice as f64 + 0.5) * stretch) as usize].clone();
    let sample_parts: Vec<Part> = (0..few).map(nearest).collect();
    let kept = prune_parts(image, camera, &sample, &sample_parts, options, |_| ())?.indices.len() as f64 * stretch;
    let pixels = image.len() as f64;
    let sections = Sections::new(camera, options.sections).inside_mm().len() as f64;
    let lenslets = pixels / camera.pitch_px().powi(2);
    let route = match Route::of(camera) {
        Route::InLine | Route::Rays => 0.0,
        // A light for each section of each lenslet, and of those beside the sensor.
        Route::Lines | Route::Tiles => 8.0 * sections * (lenslets.sqrt() + 12.0).powi(2),
    };
    let threads = rayon::current_num_threads().min(nz) as f64;
    let sums = threads * 8.0 * parts.iter().map(|[x, y]| x.len() * y.len()).max().unwrap_or(0) as f64;
    Ok(((4.0 * pixels + KEPT_BYTES * kept + route + sums) as u64, kept as u64))
}
