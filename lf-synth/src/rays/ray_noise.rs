//! The noise of the ray tracing itself, measured.

use super::{glow::Glow, instrument::Instrument, render};
use crate::particles::Particle;
use ndarray::Array2;

/// Number of particles that the noise is measured on.
pub const SAMPLE: usize = 200;

/// Renders with different rays that are averaged, to stand for one render with 100 times the rays.
const RENDERS: u64 = 100;

/// Root mean square error of the lit pixels, relative to the brightest pixel; 0 without light. Measured on the
/// [`SAMPLE`] particles nearest in x and y to the middle of all, where they overlap as in the whole frame.
pub fn measure(instrument: &Instrument, particles: &[Particle], glow: &Glow, seed: u64) -> f64 {
    let middle = particles.iter().map(|particle| particle.place_mm.truncate()).sum::<glam::DVec2>()
        / particles.len().max(1) as f64;
    let mut near = particles.to_vec();
    let distance = |particle: &Particle| (particle.place_mm.truncate() - middle).abs().max_element();
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    near.truncate(SAMPLE);
    let render = |n: u64| render::frame(instrument, &near, glow, seed ^ (n << 48), |_| ()).pixels;
    let one = render(0);
    let mut mean = Array2::<f64>::zeros(one.dim());
    for n in 1..=RENDERS {
        mean.zip_mut_with(&render(n), |sum, pixel| *sum += f64::from(*pixel) / RENDERS as f64);
    }
    let brightest = mean.iter().copied().fold(0.0, f64::max);
    let (mut squares, mut lit) = (0.0, 0u64);
    for (one, mean) in one.iter().zip(&mean) {
        if *mean > 0.0 {
            squares += (f64::from(*one) - mean).powi(2);
            lit += 1;
        }
    }
    if lit == 0 { 0.0 } else { (squares / lit as f64).sqrt() / brightest }
}
