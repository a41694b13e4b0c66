//! Estimates the memory that a fit takes.

use crate::cameras::input::CameraInput;
use crate::cameras::noise::MOST_PIXELS;
use crate::cameras::shape::{SHAPES, Shape};
use crate::cameras::view::CameraView;
use crate::model::buffers::FitBuffers;
use crate::model::particle_image::{ParticleImage, UNKNOWNS};
use crate::model::window::Rectangle;
use crate::search::particles::{AT_ONCE, Particles};
use crate::shared::sample::sample_parts;
use crate::stages::{FAINTEST_MAXIMUM, FitOptions, join, start_alone};
use lf_core::camera::Pose;
use lf_core::particle_image::ParticleModel;
use lf_core::{Grid, Refusal};

/// Bytes of a pixel of a frame: of the expected counts, of the image without defects, and of a flat field.
const FRAME_PIXEL: usize = 4;
/// Bytes of a pixel from which noise is found.
const NOISE_PIXEL: usize = 9;
/// Bytes of a pixel of what a fit leaves of a frame.
const LEFT_PIXEL: usize = 12;
/// Bytes of a particle of the frame.
const PARTICLE: usize = 300;
/// Bytes of a pixel of a window: seen and expected counts.
const WINDOW_PIXEL: usize = 8;
/// Bytes of a window's pixel in the buffers of a thread.
const THREAD_PIXEL: usize = 28;
/// Bytes of an entry of a pixel's list of particles; neighbours of a particle, and bytes of the block with one.
const ENTRY: usize = 4 + 4 * UNKNOWNS;
const NEIGHBOURS: usize = 40;
const BLOCK: usize = 4 + 4 * UNKNOWNS * UNKNOWNS;
/// Bytes of a pixel of the sample from which the shape is found, beside those of a window: derivatives before and
/// after a step, light before and after, and buffers.
const SAMPLE_PIXEL: usize = 2 * 4 * SHAPES + 8 + THREAD_PIXEL;
/// Heap bytes per live byte of particle images; allocations of many sizes fragment it. From runs with 0.1 to 1
/// particles a lenslet.
const HEAP: f64 = 2.6;
/// Smallest size, px, that is assumed where the size is fitted: a fit of larger particles may take more.
const LARGE_PX: f64 = 1.0;
/// Number of depths at which an image is tried.
const DEPTHS: usize = 64;
/// Several cameras find at most this many times the particles of the mean tile in one tile.
const FULL_TILE: usize = 2;

/// Largest number of bytes that a fit takes beside images and volumes: each camera alone, then all together. Refuses
/// what [`super::fit`] refuses of a camera or its volume. A refusal comes with the number of its camera. Sweeps in what
/// a fit leaves of an image take up to `sweep_bytes`.
pub fn estimated_bytes(
    inputs: &[CameraInput],
    options: &FitOptions,
    sweep_bytes: u64,
) -> Result<u64, (usize, Refusal)> {
    let (mut most, mut tables) = (0, 0);
    let (mut views, mut image, mut count) = (Vec::<CameraView>::new(), ImageSize::default(), 0);
    for (n, input) in inputs.iter().enumerate() {
        let mut particles = start_alone(input, &input.first, options).map_err(|refusal| (n, refusal))?;
        particles.drop_faint(FAINTEST_MAXIMUM);
        let (first, grid) = (particles.cameras.first(), input.volume.grid());
        // A size that is fitted is unknown yet.
        let sigma_px = if options.free.size { options.shape.sigma_px.max(LARGE_PX) } else { options.shape.sigma_px };
        let large = Shape { sigma_px, ..options.shape }.model_after(&first.model, first.camera, first.depth_mm);
        let large = large.map_err(|refusal| (n, refusal))?;
        // Both models share their tables; those that images of either size need are made here.
        let alone = ImageSize::new(&large, grid);
        ImageSize::new(&first.model, grid);
        tables += large.table_bytes();
        let in_tile = particles.plan().members.iter().map(Vec::len).max().unwrap_or(0);
        let sample = sample_bytes(&particles, &large, alone, options.free.camera);
        let sweeps = sweep_bytes as usize + LEFT_PIXEL * first.image.len();
        let work = work_bytes(&particles, alone, in_tile).max(sample).max(sweeps);
        most = most.max(held_bytes(&particles, particles.list.len()) + work);

        // All together, a particle has an image on each sensor.
        image = image + alone;
        count = count.max(particles.list.len());
        let mut view = particles.cameras.views.into_iter().next().expect("a list of one");
        view.pose = Pose::between(inputs[0].camera.pose.as_ref(), view.camera.pose.as_ref());
        views.push(view);
    }
    if let [_, _, ..] = inputs {
        let particles = join(views, Vec::new())?;
        let in_tile = count.min(FULL_TILE * count / particles.tiling().tiles().len());
        most = most.max(held_bytes(&particles, count) + work_bytes(&particles, image, in_tile));
    }
    Ok((most + tables) as u64)
}

/// Size of the largest window of a tile, pixels.
fn window_pixels(windows: &[Vec<Rectangle>]) -> usize {
    let area = |windows: &Vec<Rectangle>| {
        let columns = windows.iter().map(|[low, high]| high[0] - low[0]).max().unwrap_or(0);
        columns * windows.iter().map(|[low, high]| high[1] - low[1]).sum::<usize>()
    };
    windows.iter().map(area).max().unwrap_or(0)
}

/// Bytes of frames and particles.
fn held_bytes(particles: &Particles, count: usize) -> usize {
    let views = &particles.cameras.views;
    let pixels: usize = views.iter().map(|view| view.image.len()).sum();
    let flats: usize = views.iter().filter_map(|view| view.flat).map(|flat| flat.len()).sum();
    FRAME_PIXEL * (2 * pixels + flats) + PARTICLE * count
}

/// Bytes of work on tiles with up to `in_tile` particles, or on the noise. Tiles of one colour are fitted at once.
/// Covariances are found in all tiles at once, so every thread has buffers.
fn work_bytes(particles: &Particles, image: ImageSize, in_tile: usize) -> usize {
    let plan = particles.plan();
    let of_colour = |colour: &usize| plan.colours.iter().filter(|other| *other == colour).count();
    let of_colour = plan.colours.iter().map(of_colour).max().unwrap_or(0);
    let pixels = window_pixels(&plan.windows);
    let window = WINDOW_PIXEL * pixels;
    let fitted = rayon::current_num_threads().min(of_colour) * in_tile * image.fitted_bytes();
    let fits = of_colour.min(AT_ONCE) * window + fitted;
    let renders = plan.windows.len().min(AT_ONCE) * window;
    let noise = particles.cameras.views.iter().map(|view| NOISE_PIXEL * MOST_PIXELS.min(view.image.len())).max();
    let buffers = rayon::current_num_threads().min(plan.windows.len()) * THREAD_PIXEL * pixels;
    buffers + fits.max(renders).max(noise.unwrap_or(0))
}

/// Bytes of the fit of the shape.
fn sample_bytes(particles: &Particles, model: &ParticleModel, image: ImageSize, is_wide: bool) -> usize {
    let Particles { cameras, list, reach_px, .. } = particles;
    let size = cameras.first().size();
    let bytes = |[low, end]: Rectangle| {
        let side = |axis: usize| (end[axis] - low[axis] + 2 * reach_px).min(size[axis]);
        let sees = |place_mm: [f64; 3]| {
            let (place, reach) = (model.chief_px(place_mm), model.reach_px(place_mm[2]));
            let is_near =
                |axis: usize| place[axis] > low[axis] as f64 - reach && place[axis] < end[axis] as f64 + reach;
            is_near(0) && is_near(1)
        };
        let seen = list.iter().filter(|particle| sees(particle.place_mm)).count();
        (WINDOW_PIXEL + SAMPLE_PIXEL) * side(0) * side(1) + image.fitted_bytes() * seen
    };
    sample_parts(size, list.len(), *reach_px, is_wide).into_iter().map(bytes).sum()
}

/// Mean size of the image of a particle over the depths of a grid.
#[derive(Debug, Clone, Copy, Default)]
struct ImageSize {
    bytes: usize,
    pixels: usize,
}

impl std::ops::Add for ImageSize {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { bytes: self.bytes + other.bytes, pixels: self.pixels + other.pixels }
    }
}

impl ImageSize {
    fn new(model: &ParticleModel, grid: &Grid) -> Self {
        let mut buffers = FitBuffers::default();
        let (mut lenslets, mut pixels) = (0, 0);
        for n in 0..DEPTHS {
            let place =
                |axis: usize, part: f64| grid.origin_mm[axis] + part * grid.spacing_mm[axis] * grid.shape[axis] as f64;
            let z = (n as f64 + 0.5) / DEPTHS as f64;
            model.visit_places(
                [place(0, 0.5), place(1, 0.5), place(2, z)],
                1.0,
                &mut buffers.scratch,
                |patch, seen| {
                    if let Some([columns, rows]) = ParticleImage::lit(model, &patch, seen) {
                        (lenslets, pixels) = (lenslets + 1, pixels + columns.len() * rows.len());
                    }
                },
            );
        }
        Self { bytes: ParticleImage::bytes(lenslets / DEPTHS, pixels / DEPTHS), pixels: pixels / DEPTHS }
    }

    /// Bytes of a particle while it is fitted: it has two images, its entries and its blocks.
    fn fitted_bytes(self) -> usize {
        (HEAP * (2 * self.bytes + ENTRY * self.pixels + NEIGHBOURS * BLOCK) as f64) as usize
    }
}
