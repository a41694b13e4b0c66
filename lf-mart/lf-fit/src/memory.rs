//! The memory that a fit takes.

use super::buffers::Buffers;
use super::cloud::{AT_ONCE, PAIRS, SEAM, tile_at, tile_counts};
use super::image::{SpotImage, UNKNOWNS};
use super::joint::Setting;
use super::noise::Noise;
use super::recipe::{FitOptions, depths_mm, reach_px, sample_side};
use super::shape::Shape;
use super::together::{self, CameraFit, Sight};
use super::window::Rectangle;
use super::{candidates, spot::Spot};
use lf_core::camera::Pose;
use lf_core::particle_image::ParticleModel;
use lf_core::{Camera, Grid, Refusal};

/// Bytes of a pixel of the frame: the expected counts.
const FRAME_PIXEL: usize = 4;
/// Bytes of a pixel from which noise is found.
const NOISE_PIXEL: usize = 9;
/// Bytes of a particle of the frame.
const PARTICLE: usize = 300;
/// Bytes of a pixel of a window: what is seen and expected.
const WINDOW_PIXEL: usize = 8;
/// Bytes of a window's pixel in the buffers of a thread.
const THREAD_PIXEL: usize = 28;
/// Bytes of an entry of a pixel's list of particles; neighbours of a particle, and bytes of the block with one.
const ENTRY: usize = 4 + 4 * UNKNOWNS;
const NEIGHBOURS: usize = 40;
const BLOCK: usize = 4 + 4 * UNKNOWNS * UNKNOWNS;
/// Bytes of a pixel of the part of the frame that tells size and drift, beside those of a window: derivatives before and
/// after a step.
const SAMPLE_PIXEL: usize = 24;
/// Bytes that the heap takes for a byte of images: they come and go in many lengths. From runs with 0.1 to 1 particles a
/// lenslet; with images in pages of their own, which takes longer, it is 1.2.
const HEAP: f64 = 2.4;
/// The same with several threads, each of which has a heap of its own.
const HEAPS: f64 = 3.0;
/// Bytes of a pixel of a frame while several cameras are fitted together.
const TOGETHER_PIXEL: usize = 12;
/// Size of a large particle, px: a fit of larger ones may take more than is foretold.
const LARGE_PX: f64 = 1.0;
/// Depths at which images are tried.
const DEPTHS: usize = 16;

/// Most bytes that a fit takes beside the image and the volume. Refuses what [`super::fit`] refuses of the camera.
pub fn peak_bytes(
    camera: &Camera,
    (grid, indices, intensity): (&Grid, &[u64], &[f32]),
    options: &FitOptions,
) -> Result<u64, Refusal> {
    let spots = candidates::maxima(grid, indices, intensity);
    // A size that is to be found is unknown yet.
    let sigma_px = if options.free.size { options.shape.sigma_px.max(LARGE_PX) } else { options.shape.sigma_px };
    let model = Shape { sigma_px, ..options.shape }.model(camera, depths_mm(camera, grid))?;
    let size = [camera.sensor.width, camera.sensor.height];
    let reach = reach_px(camera, grid, options)?;
    let count = tile_counts(size, reach);
    let side = |axis: usize| (size[axis] / count[axis] + 2 * (reach + SEAM)).min(size[axis]);
    let window = side(0) * side(1);
    let tiles = count[0] * count[1];
    let of_colour = count[0].div_ceil(2) * count[1].div_ceil(2);
    let threads = rayon::current_num_threads();
    let (image, pixels) = image_bytes(&model, grid);
    let fitted = fitted_bytes(image, pixels);
    let in_tile = most_in_a_tile(&model, &spots, size, count);
    // All tiles are rendered at once, so every thread has buffers. It fits tiles of one colour at once.
    let buffers = threads.min(tiles) * THREAD_PIXEL * window;
    let tasks = of_colour.min(AT_ONCE) * WINDOW_PIXEL * window + threads.min(of_colour) * in_tile * fitted;
    let renders = tiles.min(AT_ONCE) * WINDOW_PIXEL * window;
    let side = sample_side(size, spots.len(), reach);
    let window = size.map(|size| (side + 2 * reach).min(size)).into_iter().product::<usize>();
    let in_sample = in_sample(&model, &spots, size, side);
    let sample = (WINDOW_PIXEL + SAMPLE_PIXEL) * window + fitted * in_sample;
    let noise = NOISE_PIXEL * PAIRS.min(size[0] * size[1]);
    let frame = FRAME_PIXEL * size[0] * size[1] + PARTICLE * spots.len();
    Ok((frame + buffers + tasks.max(renders).max(sample).max(noise)) as u64)
}

/// Bytes of a particle while it is fitted, from those of its image and its pixels: it has two images, its entries and
/// its blocks.
fn fitted_bytes(image: usize, pixels: usize) -> usize {
    let heap = if rayon::current_num_threads() > 1 { HEAPS } else { HEAP };
    (heap * (2 * image + ENTRY * pixels + NEIGHBOURS * BLOCK) as f64) as usize
}

/// Bytes of the image of a particle, and its pixels, in the mean over the depths of a grid.
fn image_bytes(model: &ParticleModel, grid: &Grid) -> (usize, usize) {
    let mut buffers = Buffers::default();
    let (mut lenslets, mut pixels) = (0, 0);
    for n in 0..DEPTHS {
        let place =
            |axis: usize, part: f64| grid.origin_mm[axis] + part * grid.spacing_mm[axis] * grid.shape[axis] as f64;
        let z = (n as f64 + 0.5) / DEPTHS as f64;
        model.visit_places([place(0, 0.5), place(1, 0.5), place(2, z)], &mut buffers.scratch, |_, seen| {
            if !SpotImage::is_out(seen) {
                (lenslets, pixels) = (lenslets + 1, pixels + seen.len());
            }
        });
    }
    (SpotImage::bytes(lenslets / DEPTHS, pixels / DEPTHS), pixels / DEPTHS)
}

/// Most particles of a tile.
fn most_in_a_tile(model: &ParticleModel, spots: &[Spot], size: [usize; 2], count: [usize; 2]) -> usize {
    let mut members = vec![0; count[0] * count[1]];
    spots.iter().for_each(|spot| members[tile_at(size, count, model.chief_px(spot.place_mm))] += 1);
    members.into_iter().max().unwrap_or(0)
}

/// Particles that the part of the sensor sees from which size and drift are found.
fn in_sample(model: &ParticleModel, spots: &[Spot], size: [usize; 2], side: usize) -> usize {
    let sees = |spot: &&Spot| {
        let (place, reach) = (model.chief_px(spot.place_mm), model.reach_px(spot.place_mm[2]));
        (0..2).all(|axis| (place[axis] - 0.5 * size[axis] as f64).abs() < 0.5 * side as f64 + reach)
    };
    spots.iter().filter(sees).count()
}

/// Most bytes that a fit of several cameras takes beside images and volumes: that of a camera alone, or that of all.
pub fn together_bytes<'a>(sights: &[Sight<'a>], options: &'a FitOptions) -> Result<u64, (usize, Refusal)> {
    let (mut alone, mut particles, mut frames) = (0, 0, 0);
    for (n, Sight { camera, image: frame, volume }) in sights.iter().enumerate() {
        alone = alone.max(peak_bytes(camera, *volume, options).map_err(|refusal| (n, refusal))?);
        let (grid, indices, intensity) = *volume;
        particles = particles.max(candidates::maxima(grid, indices, intensity).len());
        frames += TOGETHER_PIXEL * frame.len();
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
    // A particle has an image on each sensor.
    let models = std::iter::once(model).chain(views.iter().map(|view| &view.model));
    let (mut image, mut pixels) = (0, 0);
    for (model, sight) in models.zip(sights) {
        let (bytes, seen) = image_bytes(model, sight.volume.0);
        (image, pixels) = (image + bytes, pixels + seen);
    }
    let setting = Setting { model, views, noise, pixel_mm: work.pixel_mm, depth_mm: work.depth_mm };
    let area = |windows: &Vec<Rectangle>| {
        let columns = windows.iter().map(|[low, high]| high[0] - low[0]).max().unwrap_or(0);
        columns * windows.iter().map(|[low, high]| high[1] - low[1]).sum::<usize>()
    };
    let plan = work.cloud.plan(&setting);
    let mut windows: Vec<usize> = plan.windows.iter().map(area).collect();
    windows.sort_unstable_by(|a, b| b.cmp(a));
    let (tiles, most) = (windows.len(), windows[0]);
    let in_window = particles.min(2 * particles / tiles);
    // Every thread has buffers, as all tiles are rendered at once. It fits tiles of one colour at once.
    let threads = rayon::current_num_threads().min(tiles);
    let fitting = threads.min(plan.most_of_a_colour());
    let at_once: usize = windows.iter().take(AT_ONCE).sum();
    let in_threads = threads * THREAD_PIXEL * most + fitting * in_window * fitted_bytes(image, pixels);
    let all = frames + 500 * particles + WINDOW_PIXEL * at_once + in_threads;
    Ok(alone.max(all as u64))
}
