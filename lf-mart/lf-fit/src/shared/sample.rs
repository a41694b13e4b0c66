//! The parts of one camera's sensor from which the shape is found, and the particles that they see.

use crate::cameras::shape::{Free, Shape};
use crate::cameras::view::{CameraView, Cameras};
use crate::model::particle_image::ParticleImage;
use crate::model::window::{Rectangle, Window};
use crate::particle::Particle;
use lf_core::Refusal;
use lf_core::particle_image::Scratch;

/// Number of particles that are seen by the parts from which the shape is found, and their smallest side, pixels.
const SAMPLE: f64 = 200.0;
const SAMPLE_PX: f64 = 200.0;
/// The sample is this much larger where parameters of the camera are fitted. On a sensor of more than this number of
/// sides it has parts towards the corners too, this share of the way: some parameters show over the frame only.
const WIDE: f64 = 3.0;
const SIDES: usize = 3;
const OUTWARDS: f64 = 0.76;
/// Pixels are left out where the light of particles near focus exceeds this share of the noise, and those where the
/// image differs by more than this number of standard deviations: particles may be missing there.
const STRAY: f32 = 0.5;
const OUTLIER: f32 = 8.0;
/// Particles nearer to focus than this share of the scan's depths are left out.
const TOO_NEAR: f64 = 0.6;

/// Parts of one camera's sensor, and the particles that each sees.
pub(crate) struct Sample<'a> {
    /// A list of the one camera.
    pub(super) cameras: Cameras<'a>,
    pub(super) parts: Vec<SamplePart>,
    pub(super) free: Free,
}

/// A part of the sensor. Pixels of the window that are left out are blind. Its light is that of the particles that are
/// held.
pub(super) struct SamplePart {
    pub(super) window: Window,
    pub(super) particles: Vec<Particle>,
    /// Their places in the list of all.
    pub(super) places: Vec<usize>,
}

/// The parts of a sensor of `size` px: the middle, for about [`SAMPLE`] of the frame's `particles`. A wide sample has
/// more of them, and parts towards the corners of a large sensor.
pub(crate) fn sample_parts(size: [usize; 2], particles: usize, reach_px: usize, is_wide: bool) -> Vec<Rectangle> {
    let area = (size[0] * size[1]) as f64 / particles.max(1) as f64;
    let wanted = SAMPLE * if is_wide { WIDE } else { 1.0 };
    let side = ((wanted * area).sqrt() - 2.0 * reach_px as f64).max(SAMPLE_PX) as usize;
    let around = |towards: [f64; 2], side: usize| {
        let span = |axis: usize| {
            let (whole, side) = (size[axis], side.min(size[axis]));
            let low = (0.5 * (1.0 + towards[axis]) * (whole - side) as f64) as usize;
            [low, low + side]
        };
        let [columns, rows] = [span(0), span(1)];
        [[columns[0], rows[0]], [columns[1], rows[1]]]
    };
    let mut parts = vec![around([0.0; 2], side)];
    if is_wide && size.iter().all(|whole| *whole > SIDES * side) {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
        parts.extend(corners.map(|corner| around(corner.map(|sign: f64| sign * OUTWARDS), SAMPLE_PX as usize)));
    }
    parts
}

impl<'a> Sample<'a> {
    /// The parts of the first camera's sensor that see particles, by a camera of this shape. None if none does.
    pub(crate) fn new(
        cameras: &Cameras<'a>,
        shape: Shape,
        (particles, reach_px): (&[Particle], usize),
        free: Free,
    ) -> Result<Option<Self>, Refusal> {
        let view = cameras.first();
        let own = Cameras { views: vec![view.reshaped(shape, view.depth_mm)?] };
        let rectangles = sample_parts(view.size(), particles.len(), reach_px, free.lens.contains(&true));
        let parts = rectangles.iter().map(|part| SamplePart::new(cameras, &own, particles, reach_px, *part));
        let parts: Vec<SamplePart> = parts.filter(|part| !part.particles.is_empty()).collect();
        Ok((!parts.is_empty()).then_some(Self { cameras: own, parts, free }))
    }
}

impl SamplePart {
    /// Cuts a part out of the first camera's sensor. `own` is a list of that camera alone.
    fn new(cameras: &Cameras, own: &Cameras, particles: &[Particle], reach_px: usize, part: Rectangle) -> Self {
        let view = cameras.first();
        let [first, end] = part;

        // Add a margin that its particles may light.
        let size = view.size();
        let low = first.map(|low| low.saturating_sub(reach_px));
        let high = [0, 1].map(|axis| (end[axis] + reach_px).min(size[axis]));
        let mut window = Window::cut(&cameras.views[..1], &[[low, high]]);

        // Hold the particles near focus, unless they are the majority.
        let sees = |(_, particle): &(usize, Particle)| {
            let place = view.model.chief_px(particle.place_mm);
            let reach = view.model.reach_px(particle.place_mm[2]);
            (0..2).all(|axis| place[axis] > first[axis] as f64 - reach && place[axis] < end[axis] as f64 + reach)
        };
        let too_near = TOO_NEAR * view.near_focus_mm();
        let seen: Vec<(usize, Particle)> = particles.iter().copied().enumerate().filter(sees).collect();
        let is_near = |(_, particle): &&(usize, Particle)| particle.place_mm[2].abs() < too_near;
        let (near, far): (Vec<_>, Vec<_>) = seen.iter().partition(is_near);
        let (held, free) = if far.len() > near.len() { (near, far) } else { (Vec::new(), seen) };
        let (places, particles) = free.into_iter().unzip();
        let mut stray = vec![0f32; window.seen.len()];
        let mut scratch = Scratch::default();
        for (_, particle) in &held {
            let image = ParticleImage::light(own, particle, &window, &mut scratch);
            image.add_to(&mut stray, window.columns, 1.0);
        }

        // Leave out the margin, the light of what is held, and outliers.
        for (n, (light, stray)) in window.light.iter_mut().zip(&stray).enumerate() {
            let place = [low[0] + n % window.columns, low[1] + n / window.columns];
            let is_beyond = (0..2).any(|axis| !(first[axis]..end[axis]).contains(&place[axis]));
            let noise = view.noise.variance(*light).sqrt();
            let seen = &mut window.seen[n];
            if is_beyond || *stray > STRAY * noise || (*seen - *light).abs() > OUTLIER * noise {
                *seen = f32::NAN;
            }
            *light = *stray;
        }
        // Another pattern has other light there.
        let pattern = |view: &CameraView| (view.model.halo().is_some(), view.model.follows_waves());
        if pattern(own.first()) == pattern(view) {
            for (n, light) in window.light.iter_mut().enumerate() {
                *light += view.held((low[1] + n / window.columns) * size[0] + low[0] + n % window.columns);
            }
        }
        Self { window, particles, places }
    }
}
