//! The memory that a fit takes.

use super::candidates;
use super::cloud::{AT_ONCE, SEAM, tile_counts};
use super::joint::Setting;
use super::noise::Noise;
use super::recipe::{FitOptions, reach_px};
use super::together::{self, CameraFit, Sight};
use super::window::Rectangle;
use lf_core::camera::Pose;
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

/// Most bytes that a fit of several cameras takes beside images and volumes: that of a camera alone, or that of all.
pub fn together_bytes<'a>(sights: &[Sight<'a>], options: &'a FitOptions) -> Result<u64, (usize, Refusal)> {
    let (mut alone, mut particles, mut frames) = (0, 0, 0);
    for (n, Sight { camera, image, volume }) in sights.iter().enumerate() {
        alone = alone.max(peak_bytes(camera, *volume, options).map_err(|refusal| (n, refusal))?);
        let (grid, indices, intensity) = *volume;
        particles = particles.max(candidates::maxima(grid, indices, intensity).len());
        frames += FRAME_PIXEL * image.len();
    }
    let noise = Noise { gain: 1.0, read_variance: 1.0 };
    let camera = |sight: &Sight<'a>| CameraFit {
        shape: options.shape,
        shape_std_px: [0.0; 3],
        noise,
        light: 1.0,
        pose: Pose::between(sights[0].camera.pose.as_ref(), sight.camera.pose.as_ref()),
        particles: 0,
        shared: 0,
    };
    let cameras: Vec<CameraFit> = sights.iter().map(camera).collect();
    let work = together::begin(sights, options, &cameras, Vec::new())?;
    let (model, views) = (&work.model, work.views.as_slice());
    let setting = Setting { model, views, noise, pixel_mm: work.pixel_mm, depth_mm: work.depth_mm };
    let pixels = |windows: &Vec<Rectangle>| {
        let columns = windows.iter().map(|[low, high]| high[0] - low[0]).max().unwrap_or(0);
        columns * windows.iter().map(|[low, high]| high[1] - low[1]).sum::<usize>()
    };
    let mut windows: Vec<usize> = work.cloud.plan(&setting).windows.iter().map(pixels).collect();
    windows.sort_unstable_by(|a, b| b.cmp(a));
    let (tiles, most) = (windows.len(), windows[0]);
    let in_window = particles.min(2 * particles / tiles);
    let thread = THREAD_PIXEL * most + sights.len() * THREAD_PARTICLE * in_window;
    let at_once: usize = windows.iter().take(AT_ONCE).sum();
    let threads = rayon::current_num_threads().min(tiles);
    let all = frames + 500 * particles + WINDOW_PIXEL * at_once + threads * thread;
    Ok(alone.max(all as u64))
}
