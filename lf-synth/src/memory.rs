//! The memory that images and truths take, before they are made.

use crate::particles::Particle;
use crate::rays::{Glow, Instrument, WhiteCells, frame_bytes, white_bytes};
use crate::scene::Truth;
use crate::sensor::SensorNoise;
use crate::truth;
use lf_core::Grid;

/// Bytes of a particle in the text of a `particles.csv`.
const LINE_BYTES: f64 = 75.0;
/// Bytes of a pixel of an image that is saved: its value, and a copy for the encoder.
const SAVED_BYTES: f64 = 4.0 + 4.0;
/// Bytes of an encoded pixel, with noise in every digit and without: counts of rays repeat.
const ENCODED_BYTES: [f64; 2] = [4.1, 2.6];
/// Bytes of a vector of the exact displacement: its place, its numbers in memory, and the file.
const VECTOR_BYTES: f64 = 24.0 + 24.0 + 37.0 + 2.0 * 40.0;

/// Bytes to save an image of `pixels` pixels.
fn save_bytes(pixels: f64, noise: Option<&SensorNoise>) -> f64 {
    let is_noisy = noise.is_some_and(|noise| noise.bits.is_none());
    pixels * (SAVED_BYTES + ENCODED_BYTES[usize::from(!is_noisy)])
}

/// Peak bytes of a white image.
pub fn white(instrument: &Instrument, cells: &WhiteCells, noise: Option<&SensorNoise>) -> f64 {
    white_bytes(instrument, cells).max(dark(instrument, noise))
}

/// Peak bytes of an image without rays.
pub fn dark(instrument: &Instrument, noise: Option<&SensorNoise>) -> f64 {
    save_bytes(instrument.pixels(), noise)
}

/// Peak bytes of a measurement of the noise: an image, its mean so far, and the next one.
pub fn measured_noise(instrument: &Instrument) -> f64 {
    instrument.pixels() * (4.0 + 8.0 + 4.0)
}

/// Peak bytes of a series of `frames` images of particles, with the lists of particles that are kept for its table.
/// The particles themselves, `all` in one frame, are not counted.
pub fn frames(
    instrument: &Instrument,
    all: &[Particle],
    glow: &Glow,
    frames: usize,
    noise: Option<&SensorNoise>,
    truth: Option<(&Truth, &Grid)>,
) -> f64 {
    let count = all.len() as f64;
    let listed = (frames * all.len() * size_of::<Particle>()) as f64;
    let exact = truth.map_or(0.0, |(truth, grid)| truth::bytes(grid, count, truth.sigma_vox));
    let vectors = truth.map_or(0.0, |(truth, _)| truth.vectors.iter().product::<usize>() as f64);
    let written = (LINE_BYTES * count * frames as f64).max(VECTOR_BYTES * vectors);
    listed + frame_bytes(instrument, all, glow).max(dark(instrument, noise)).max(exact).max(written)
}
