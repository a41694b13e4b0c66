//! The memory that a fit takes.

use super::candidates;
use super::cloud::{AT_ONCE, SEAM, tile_counts};
use super::recipe::{FitOptions, reach_px};
use lf_core::{Camera, Grid, Refusal};

/// Bytes of a pixel of the frame: light, and expected counts with differences for the noise.
const FRAME_PIXEL: usize = 12;
/// Bytes of a pixel of a window: what is seen and expected.
const WINDOW_PIXEL: usize = 8;
/// Bytes of a window's pixel in the buffers of a thread, and of a particle there: its image before and after a step,
/// the entries of its pixels, and its blocks.
const THREAD_PIXEL: usize = 32;
const THREAD_PARTICLE: usize = 120_000;
/// Particles of the part of the frame that tells size and drift, and bytes of one.
const SAMPLE: usize = 400;
const SAMPLE_PARTICLE: usize = 80_000;

/// Most bytes that a fit takes beside the image and the volume. Refuses what [`super::fit`] refuses of the camera.
pub fn peak_bytes(
    camera: &Camera,
    (grid, indices, intensity): (&Grid, &[u64], &[f32]),
    options: &FitOptions,
) -> Result<u64, Refusal> {
    let particles = candidates::maxima(grid, indices, intensity).len();
    let size = [camera.sensor.width, camera.sensor.height];
    let reach = reach_px(camera, grid, options)?;
    let count = tile_counts(size, reach);
    let side = |axis: usize| (size[axis] / count[axis] + 2 * (reach + SEAM)).min(size[axis]);
    let window = side(0) * side(1);
    let tiles = count[0] * count[1];
    let (threads, at_once) = (rayon::current_num_threads().min(tiles), tiles.div_ceil(2).min(AT_ONCE));
    let in_window = particles.min(2 * particles / tiles);
    let frame = FRAME_PIXEL * size[0] * size[1] + 200 * particles;
    let threads = threads * (THREAD_PIXEL * window + THREAD_PARTICLE * in_window);
    let sample = SAMPLE_PARTICLE * particles.min(SAMPLE) + (WINDOW_PIXEL + 12) * window;
    Ok((frame + at_once * WINDOW_PIXEL * window + threads.max(sample)) as u64)
}
