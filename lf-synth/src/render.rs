//! Rays to images.
//!
//! A ray carries an even share of its particle's counts. The rays of one particle are counted in a patch of the sensor, and
//! patches are added to the image in the order of the particles, so the image has the same bytes for any number of threads.
//! Each step of the way is a loop over a few hundred rays; one that the scene does not ask for is not run.

use crate::diffraction::Pattern;
use crate::light::SecondStop;
use crate::particles::{Particle, stream};
use crate::patch::{self, Patch};
use crate::samples::{Samples, Shape};
use glam::DVec2;
use lf_core::camera::Camera;
use lf_core::optics::Optics;
use lf_core::simd::fastest;
use ndarray::Array2;
use rayon::prelude::*;

/// An image, and the counts that reached it.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// Counts, shape (height, width).
    pub pixels: Array2<f32>,
    /// Counts sent through the aperture.
    pub emitted: f64,
    /// Counts that fell on the sensor.
    pub arrived: f64,
    /// Rays cast.
    pub rays: u64,
}

/// A camera and what else bends or stops its rays.
#[derive(Debug)]
pub struct Instrument {
    optics: Optics,
    aperture: Shape,
    second_stop: Option<SecondStop>,
    diffraction: Option<Pattern>,
    /// Width and height of the sensor, px.
    size: [usize; 2],
    pixel_pitch_mm: f64,
    /// A lenslet and what diffraction adds to it, px.
    margin_px: f64,
}

/// What a particle sends out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glow {
    /// Shape of its image in focus.
    pub shape: Shape,
    /// Standard deviation of a Gaussian one, radius of a disc, in the object, mm.
    pub size_mm: f64,
    /// How many rays it sends.
    pub rays: Rays,
}

/// How many rays a particle sends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rays {
    /// The same for all.
    Each(u32),
    /// So many at this intensity, in counts; others as their brightness asks for the same noise in counts.
    At(u32, f64),
}

/// A particle brighter or fainter than the one that a noise is asked for has no more than so many times, or less than a
/// so-manieth of, its rays.
const UNEVEN: f64 = 8.0;

impl Rays {
    /// Rays of a particle.
    pub fn of(self, intensity: f64) -> usize {
        match self {
            Self::Each(rays) => rays as usize,
            // Noise falls with the number of rays to the power of 3/4: see `scene::rays_for_noise`.
            Self::At(rays, bright) => {
                let share = (intensity / bright).powf(4.0 / 3.0).clamp(1.0 / UNEVEN, UNEVEN);
                (f64::from(rays) * share).ceil() as usize
            }
        }
    }
}

/// Rays in flight at a time; their arrays stay in the nearest cache.
const FLIGHT: usize = 256;

/// Rays in flight: place in the aperture; place on the object, then the array, then the sensor; mm.
struct Flight {
    u: [f64; FLIGHT],
    v: [f64; FLIGHT],
    x: [f64; FLIGHT],
    y: [f64; FLIGHT],
    /// Whether a second stop holds it back.
    blocked: [bool; FLIGHT],
    /// Pixel from the corner of the patch.
    column: [i32; FLIGHT],
    row: [i32; FLIGHT],
}

impl Flight {
    const START: Self = Self {
        u: [0.0; FLIGHT],
        v: [0.0; FLIGHT],
        x: [0.0; FLIGHT],
        y: [0.0; FLIGHT],
        blocked: [false; FLIGHT],
        column: [0; FLIGHT],
        row: [0; FLIGHT],
    };
}

/// A part of the array lit in white, in tiles that each send the same rays.
struct Tiles {
    columns: usize,
    rows: usize,
    corner_mm: DVec2,
    side_mm: DVec2,
    rays: usize,
    counts_per_ray: f64,
}

/// Patches in memory at a time.
const BATCH: usize = 64;

impl Instrument {
    /// The rays of a checked camera.
    pub fn new(camera: &Camera, second_stop: Option<SecondStop>, diffraction: Option<Pattern>) -> Self {
        let reach_mm = diffraction.as_ref().map_or(0.0, |pattern| 4.0 * pattern.unit_mm());
        Self {
            optics: Optics::new(camera),
            aperture: camera.main_lens.aperture.into(),
            second_stop,
            diffraction,
            size: [camera.sensor.width, camera.sensor.height],
            pixel_pitch_mm: camera.sensor.pixel_pitch_mm,
            margin_px: camera.pitch_px() + reach_mm / camera.sensor.pixel_pitch_mm + 2.0,
        }
    }

    /// Renders particles. `done` is told how many are finished.
    pub fn frame(&self, particles: &[Particle], glow: &Glow, seed: u64, done: impl Fn(u64) + Sync) -> Rendered {
        let most = particles.iter().map(|particle| glow.rays.of(particle.intensity)).max().unwrap_or(0);
        let samples = Samples::new(most, self.aperture, glow.shape);
        let emitted = particles.iter().map(|particle| particle.intensity).sum();
        let rays = particles.iter().map(|particle| glow.rays.of(particle.intensity) as u64).sum();
        let mut rendered = self.collect(particles, |particle, patch| {
            fastest(
                #[inline(always)]
                || self.cast(&samples, glow, particle, seed, patch),
            );
            done(1);
        });
        (rendered.emitted, rendered.rays) = (emitted, rays);
        rendered
    }

    /// Renders an evenly lit aperture seen through every lenslet of the sensor with `rays` rays each; a pixel that sees
    /// nothing but lit aperture holds `level` counts. `done` is told how many rows of the array are finished.
    pub fn white(&self, camera: &Camera, level: f64, rays: u32, seed: u64, done: impl Fn(u64) + Sync) -> Rendered {
        let pitch_mm = camera.microlenses.pitch_mm;
        let half = 0.5 * self.pixel_pitch_mm * DVec2::new(self.size[0] as f64, self.size[1] as f64);
        // Lit area of the array: the sensor and three lenslets around it.
        let reach = half + 3.0 * pitch_mm;
        let count = (2.0 * reach / pitch_mm).ceil();
        let side_mm = 2.0 * reach / count;
        // A pixel's share of its lenslet's light is its area over that of the aperture's image.
        let image_side_mm = camera.demagnification() * camera.aperture_mm();
        let filled = if self.aperture == Shape::Disc { std::f64::consts::FRAC_PI_4 } else { 1.0 };
        let per_lenslet = level * image_side_mm.powi(2) * filled / self.pixel_pitch_mm.powi(2);
        let per_tile = per_lenslet * side_mm.x * side_mm.y / camera.lattice().cell_area_mm2();
        let tiles = Tiles {
            columns: count.x as usize,
            rows: count.y as usize,
            corner_mm: -reach,
            side_mm,
            rays: rays as usize,
            counts_per_ray: per_tile / f64::from(rays),
        };
        let samples = Samples::new(tiles.rays, self.aperture, Shape::Square);
        let rows: Vec<usize> = (0..tiles.rows).collect();
        let mut rendered = self.collect(&rows, |&row, patch| {
            fastest(
                #[inline(always)]
                || self.cast_tiles(&samples, &tiles, row, seed, patch),
            );
            done(1);
        });
        rendered.emitted = per_tile * count.x * count.y;
        rendered.rays = (tiles.columns * tiles.rows * tiles.rays) as u64;
        rendered
    }

    /// Adds up the patches of many sources in their order.
    fn collect<T: Sync>(&self, sources: &[T], cast: impl Fn(&T, &mut Patch) + Sync) -> Rendered {
        let [width, height] = self.size;
        let mut pixels = Array2::zeros((height, width));
        let mut arrived = 0.0;
        let mut patches: Vec<Patch> = (0..BATCH.min(sources.len())).map(|_| Patch::default()).collect();
        for batch in sources.chunks(BATCH) {
            let patches = &mut patches[..batch.len()];
            batch
                .par_iter()
                .zip(patches.par_iter_mut())
                .with_max_len(1)
                .for_each(|(source, patch)| cast(source, patch));
            patch::add(&mut pixels, patches);
            arrived += patches.iter().map(Patch::arrived).sum::<f64>();
        }
        Rendered { pixels, emitted: 0.0, arrived, rays: 0 }
    }

    /// Casts a particle's rays.
    #[inline(always)]
    fn cast(&self, samples: &Samples, glow: &Glow, particle: &Particle, seed: u64, patch: &mut Patch) {
        let rays = glow.rays.of(particle.intensity);
        let mut random = stream(seed ^ 0x7261_7973, particle.id);
        let in_aperture = self.aperture.motion(&mut random);
        let in_image = glow.shape.motion(&mut random);
        let start = self.diffraction.as_ref().map_or(0, |pattern| pattern.start(&mut random));
        let (centre, z_mm) = (particle.place_mm.truncate(), particle.place_mm.z);
        let (half, size) = (self.optics.half_aperture_mm(), glow.size_mm * particle.size);
        let [low, high] = self.bounds_px(particle, size);
        patch.clear(low, high, self.size, particle.intensity / rays as f64);
        let mut flight = Flight::START;
        for first in (0..rays).step_by(FLIGHT) {
            let n = FLIGHT.min(rays - first);
            let Flight { u, v, x, y, .. } = &mut flight;
            in_aperture.apply(samples.first(first, n), half, &mut u[..n], &mut v[..n]);
            in_image.apply(samples.second(first, n), size, &mut x[..n], &mut y[..n]);
            for i in 0..n {
                let point = centre + DVec2::new(x[i], y[i]);
                let hit = self.optics.array_from_object(point, z_mm, DVec2::new(u[i], v[i]));
                (x[i], y[i]) = (hit.x, hit.y);
            }
            self.finish(&mut flight, n, start + first, patch);
        }
    }

    /// Casts the rays through one row of tiles.
    #[inline(always)]
    fn cast_tiles(&self, samples: &Samples, tiles: &Tiles, row: usize, seed: u64, patch: &mut Patch) {
        let half = self.optics.half_aperture_mm();
        let top_mm = tiles.corner_mm.y + row as f64 * tiles.side_mm.y;
        let reach_px = self.margin_px + half * self.optics.demagnification() / self.pixel_pitch_mm;
        let edge_px = |y_mm: f64| self.optics.place_px(DVec2::new(0.0, y_mm)).y;
        let low = [0.0, edge_px(top_mm) - reach_px];
        let high = [self.size[0] as f64, edge_px(top_mm + tiles.side_mm.y) + reach_px];
        patch.clear(low, high, self.size, tiles.counts_per_ray);
        let mut flight = Flight::START;
        for column in 0..tiles.columns {
            let mut random = stream(seed ^ 0x7768_6974, (row * tiles.columns + column) as u64);
            let in_aperture = self.aperture.motion(&mut random);
            let in_tile = Shape::Square.motion(&mut random);
            let start = self.diffraction.as_ref().map_or(0, |pattern| pattern.start(&mut random));
            let centre = tiles.corner_mm + tiles.side_mm * DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
            for first in (0..tiles.rays).step_by(FLIGHT) {
                let n = FLIGHT.min(tiles.rays - first);
                let Flight { u, v, x, y, .. } = &mut flight;
                in_aperture.apply(samples.first(first, n), half, &mut u[..n], &mut v[..n]);
                in_tile.apply(samples.second(first, n), 0.5, &mut x[..n], &mut y[..n]);
                for i in 0..n {
                    (x[i], y[i]) = (centre.x + tiles.side_mm.x * x[i], centre.y + tiles.side_mm.y * y[i]);
                }
                self.finish(&mut flight, n, start + first, patch);
            }
        }
    }

    /// Takes rays that have met the array to the sensor and counts them; `sample` is the number of the first.
    #[inline(always)]
    fn finish(&self, flight: &mut Flight, n: usize, sample: usize, patch: &mut Patch) {
        let Flight { u, v, x, y, blocked, column, row } = flight;
        if let Some(stop) = &self.second_stop {
            for i in 0..n {
                blocked[i] = !stop.passes(&self.optics, DVec2::new(x[i], y[i]), DVec2::new(u[i], v[i]));
            }
        }
        for i in 0..n {
            let hit = self.optics.sensor_from_array(DVec2::new(x[i], y[i]), DVec2::new(u[i], v[i]));
            (x[i], y[i]) = (hit.x, hit.y);
        }
        if let Some(pattern) = &self.diffraction {
            pattern.deflect(sample, &mut x[..n], &mut y[..n]);
        }
        let corner = DVec2::from(patch.corner());
        for i in 0..n {
            let place = (self.optics.place_px(DVec2::new(x[i], y[i])) - corner).floor();
            (column[i], row[i]) = (place.x as i32, place.y as i32);
        }
        if self.second_stop.is_some() {
            for i in 0..n {
                if blocked[i] {
                    column[i] = i32::MIN;
                }
            }
        }
        patch.count(&column[..n], &row[..n], self.size);
    }

    /// Pixels that hold a particle's image: what comes through the rim of the aperture, and a margin.
    fn bounds_px(&self, particle: &Particle, size_mm: f64) -> [[f64; 2]; 2] {
        const RIM: usize = 12;
        // A rim beyond the corners of a square stop.
        let radius = self.optics.half_aperture_mm() * if self.aperture == Shape::Disc { 1.0 } else { 1.5 };
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for n in 0..RIM {
            let rim = radius * DVec2::from_angle(std::f64::consts::TAU * n as f64 / RIM as f64);
            let hit = self.optics.array_from_object(particle.place_mm.truncate(), particle.place_mm.z, rim);
            let place = self.optics.place_px(self.optics.sensor_from_array(hit, rim));
            (low, high) = (low.min(place), high.max(place));
        }
        let blur = 5.0 * size_mm * self.optics.beta(particle.place_mm.z).abs() / self.pixel_pitch_mm;
        [(low - self.margin_px - blur).to_array(), (high + self.margin_px + blur).to_array()]
    }
}
