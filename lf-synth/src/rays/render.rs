//! From rays to images.
//!
//! Each ray carries an equal share of its particle's counts. The rays of one particle are counted in a tally of part of
//! the sensor. Tallies are added to the image in the order of the particles, so that the image has the same bytes for
//! any number of threads.

use super::instrument::Instrument;
use super::samples::{SAMPLE_BYTES, Samples, Shape};
use super::sources::{Glow, WhiteCells};
use super::tally::{self, Tally};
use crate::particles::Particle;
use glam::DVec2;
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

/// Tallies in memory at a time.
const BATCH: usize = 64;

/// Renders particles. `done` is called with the number of particles finished since its last call.
pub fn frame(
    instrument: &Instrument,
    particles: &[Particle],
    glow: &Glow,
    seed: u64,
    done: impl Fn(u64) + Sync,
) -> Rendered {
    let rays = |particle: &Particle| glow.rays.of_intensity(particle.intensity);
    let samples = Samples::new(particles.iter().map(rays).max().unwrap_or(0), instrument.aperture, glow.shape);
    let emitted = particles.iter().map(|particle| particle.intensity).sum();
    let cast_rays = particles.iter().map(|particle| rays(particle) as u64).sum();
    let most_px = tallies_px(instrument, particles, glow).fold(0.0, f64::max);
    let (pixels, arrived) = collect(instrument.size, particles, most_px, |particle, tally| {
        fastest(
            #[inline(always)]
            || instrument.cast(&samples, glow, particle, seed, tally),
        );
        done(1);
    });
    Rendered { pixels, emitted, arrived, rays: cast_rays }
}

/// Renders an evenly lit aperture through every lenslet of the sensor. `done` is called with the number of rows of
/// cells finished since its last call.
pub fn white(instrument: &Instrument, cells: &WhiteCells, seed: u64, done: impl Fn(u64) + Sync) -> Rendered {
    let samples = Samples::new(cells.rays_per_cell, instrument.aperture, Shape::Square);
    let rows: Vec<usize> = (0..cells.rows).collect();
    let (pixels, arrived) = collect(instrument.size, &rows, instrument.row_px(cells), |&row, tally| {
        fastest(
            #[inline(always)]
            || instrument.cast_row(&samples, cells, row, seed, tally),
        );
        done(1);
    });
    let emitted = cells.counts_per_cell * cells.columns as f64 * cells.rows as f64;
    Rendered { pixels, emitted, arrived, rays: (cells.columns * cells.rows * cells.rays_per_cell) as u64 }
}

/// Largest number of bytes that [`frame`] takes: the image, a table of samples, and a batch of tallies.
pub fn frame_bytes(instrument: &Instrument, particles: &[Particle], glow: &Glow) -> f64 {
    let rays = particles.iter().map(|particle| glow.rays.of_intensity(particle.intensity)).max().unwrap_or(0);
    let mut tallies: Vec<f64> = tallies_px(instrument, particles, glow).collect();
    tallies.sort_unstable_by(|a, b| b.total_cmp(a));
    let wave = particles.iter().map(|particle| instrument.wave_bytes(particle, glow)).fold(0.0, f64::max);
    rendered_bytes(instrument, rays, tallies.iter().take(BATCH).sum()) + wave * rayon::current_num_threads() as f64
}

/// Largest number of bytes that [`white`] takes.
pub fn white_bytes(instrument: &Instrument, cells: &WhiteCells) -> f64 {
    rendered_bytes(instrument, cells.rays_per_cell, BATCH.min(cells.rows) as f64 * instrument.row_px(cells))
}

fn rendered_bytes(instrument: &Instrument, rays: usize, tally_px: f64) -> f64 {
    let [pixels, tallies] = [instrument.pixels(), tally_px].map(|pixels| pixels * size_of::<f32>() as f64);
    pixels + tallies + SAMPLE_BYTES * rays as f64
}

/// Pixels of the tallies of particles.
fn tallies_px<'a>(instrument: &'a Instrument, particles: &'a [Particle], glow: &'a Glow) -> impl Iterator<Item = f64> {
    particles.iter().map(|particle| instrument.tally_px(particle, glow))
}

/// Casts the rays of many sources and adds up their tallies, of at most `most_px` pixels, in order. Returns the image
/// and the counts that arrived.
fn collect<T: Sync>(
    [width, height]: [usize; 2],
    sources: &[T],
    most_px: f64,
    cast: impl Fn(&T, &mut Tally) + Sync,
) -> (Array2<f32>, f64) {
    let mut pixels = Array2::zeros((height, width));
    let mut arrived = 0.0;
    let mut tallies: Vec<Tally> = (0..BATCH.min(sources.len())).map(|_| Tally::with_capacity(most_px)).collect();
    for batch in sources.chunks(BATCH) {
        let tallies = &mut tallies[..batch.len()];
        batch.par_iter().zip(tallies.par_iter_mut()).with_max_len(1).for_each(|(source, tally)| cast(source, tally));
        tally::add(&mut pixels, tallies);
        arrived += tallies.iter().map(Tally::arrived).sum::<f64>();
    }
    (pixels, arrived)
}

/// Number of particles that [`measure_noise`] renders.
pub const NOISE_SAMPLE: usize = 200;

/// Renders with different rays that are averaged, to stand for one render with 100 times the rays.
const RENDERS: u64 = 100;

/// Measures the noise of the ray tracing: root mean square error of the lit pixels, relative to the brightest pixel; 0
/// without light. Takes the [`NOISE_SAMPLE`] particles nearest in x and y to the middle of all, where they overlap as
/// in the whole frame.
pub fn measure_noise(instrument: &Instrument, particles: &[Particle], glow: &Glow, seed: u64) -> f64 {
    let middle =
        particles.iter().map(|particle| particle.place_mm.truncate()).sum::<DVec2>() / particles.len().max(1) as f64;
    let mut near = particles.to_vec();
    let distance = |particle: &Particle| (particle.place_mm.truncate() - middle).abs().max_element();
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    near.truncate(NOISE_SAMPLE);
    let render = |n: u64| frame(instrument, &near, glow, seed ^ (n << 48), |_| ()).pixels;
    let one = render(0);
    let mut mean = Array2::<f64>::zeros(one.dim());
    for n in 1..=RENDERS {
        mean.zip_mut_with(&render(n), |sum, pixel| *sum += f64::from(*pixel) / RENDERS as f64);
    }
    let brightest = mean.iter().copied().fold(0.0, f64::max);
    let lit = one.iter().zip(&mean).filter(|(_, mean)| **mean > 0.0);
    let squares = lit.clone().map(|(one, mean)| (f64::from(*one) - mean).powi(2)).sum::<f64>();
    let count = lit.count();
    if count == 0 { 0.0 } else { (squares / count as f64).sqrt() / brightest }
}
