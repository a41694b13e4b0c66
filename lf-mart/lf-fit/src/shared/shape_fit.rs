//! Fits the unknowns that all particles share: their size, the drift of the lattice, the blur. The particles that a
//! part of one camera's sensor sees are fitted along with them.

use crate::cameras::shape::{ANALYTIC, Free, SHAPES, Shape};
use crate::cameras::view::Cameras;
use crate::model::buffers::FitBuffers;
use crate::model::particle_image::{ParticleImage, Slopes, UNKNOWNS};
use crate::model::window::Window;
use crate::particle::Particle;
use crate::solve::joint::{DAMPING, LEAST_DAMPING, LESS, MORE};
use crate::solve::normal::{DEEP, Normal, cholesky, conjugate_gradients, dot};
use lf_core::Refusal;
use lf_core::linear::{inverse_column, solve};
use lf_core::particle_image::Scratch;
use rayon::prelude::*;

/// Particles that are rendered before their derivatives are added up; bounds the memory.
const AT_ONCE: usize = 64;
/// Longest step, pixels.
const STEP_PX: f64 = 0.1;
/// Largest number of steps.
const STEPS: usize = 10;
/// The fit ends if a step needs more damping than this.
const MOST_DAMPING: f64 = 10.0;
/// The fit ends if every unknown moves by less than this share of its uncertainty.
const ENOUGH: f64 = 0.2;
/// Number of particles seen by the part of the sensor from which the shape is found, and its smallest side, pixels.
const SAMPLE: f64 = 200.0;
const SAMPLE_PX: f64 = 200.0;
/// The sample is this much larger where parameters of the camera are fitted: some show over the frame only.
const WIDE: f64 = 3.0;
/// Distance, to either side, of the shapes whose lights give the slopes by a camera's parameter, pixels.
const SLOPE_PX: f64 = 0.015;
/// The shape's fit leaves out pixels where the light of particles near focus exceeds this share of the noise, and those
/// where the image differs by more than this number of standard deviations: particles may be missing there.
const STRAY: f32 = 0.5;
const OUTLIER: f32 = 8.0;
/// The shape's fit leaves out particles nearer to focus than this share of the scan's depths.
const TOO_NEAR: f64 = 0.6;

/// The result of a fit of the shape.
pub(crate) struct FoundShape {
    pub(crate) shape: Shape,
    /// Standard uncertainties of the size and of both drifts, pixels.
    pub(crate) std_px: [f64; SHAPES],
    /// Whether the last step was below the uncertainty.
    pub(crate) is_settled: bool,
}

/// A part of one camera's sensor, and the particles that it sees. Pixels of the window that are left out are blind. Its
/// light is that of the particles that are held.
pub(crate) struct Sample<'a> {
    /// A list of the one camera.
    pub(super) cameras: Cameras<'a>,
    window: Window,
    particles: Vec<Particle>,
    pub(super) free: Free,
}

/// Side of a square, px, that holds about [`SAMPLE`] of the frame's `particles`, or more if it is wide.
pub(crate) fn sample_side(size: [usize; 2], particles: usize, reach_px: usize, is_wide: bool) -> usize {
    let area = (size[0] * size[1]) as f64 / particles.max(1) as f64;
    let wanted = SAMPLE * if is_wide { WIDE } else { 1.0 };
    ((wanted * area).sqrt() - 2.0 * reach_px as f64).max(SAMPLE_PX) as usize
}

impl<'a> Sample<'a> {
    /// The middle of the first camera's sensor. None if it sees no particle.
    pub(crate) fn new(
        cameras: &Cameras<'a>,
        particles: &[Particle],
        reach_px: usize,
        free: Free,
    ) -> Result<Option<Self>, Refusal> {
        let view = cameras.first();
        let own = Cameras { views: vec![view.reshaped(view.shape, view.depth_mm)?] };

        // Cut out the middle of the sensor, with a margin that its particles may light.
        let size = view.size();
        let side = sample_side(size, particles.len(), reach_px, free.lens.contains(&true));
        let part = size.map(|whole| [whole.saturating_sub(side) / 2, (whole + side.min(whole)).div_ceil(2)]);
        let low = part.map(|[low, _]| low.saturating_sub(reach_px));
        let high = [0, 1].map(|axis| (part[axis][1] + reach_px).min(size[axis]));
        let mut window = Window::cut(&cameras.views[..1], &[[low, high]]);

        // Hold the particles near focus, unless they are the majority.
        let sees = |particle: &&Particle| {
            let place = view.model.chief_px(particle.place_mm);
            let reach = view.model.reach_px(particle.place_mm[2]);
            (0..2).all(|axis| place[axis] > part[axis][0] as f64 - reach && place[axis] < part[axis][1] as f64 + reach)
        };
        let too_near = TOO_NEAR * view.near_focus_mm();
        let seen: Vec<Particle> = particles.iter().filter(sees).copied().collect();
        let is_near = |particle: &Particle| particle.place_mm[2].abs() < too_near;
        let (near, far): (Vec<Particle>, Vec<Particle>) = seen.iter().partition(|particle| is_near(particle));
        let (held, particles) = if far.len() > near.len() { (near, far) } else { (Vec::new(), seen) };
        let mut stray = vec![0f32; window.seen.len()];
        let mut scratch = Scratch::default();
        for particle in &held {
            let image = ParticleImage::light(&own, particle, &window, &mut scratch);
            image.add_to(&mut stray, window.columns, 1.0);
        }

        // Leave out the margin, the light of what is held, and outliers.
        for (n, (light, stray)) in window.light.iter_mut().zip(&stray).enumerate() {
            let place = [low[0] + n % window.columns, low[1] + n / window.columns];
            let is_beyond = (0..2).any(|axis| !(part[axis][0]..part[axis][1]).contains(&place[axis]));
            let noise = view.noise.variance(*light).sqrt();
            let seen = &mut window.seen[n];
            if is_beyond || *stray > STRAY * noise || (*seen - *light).abs() > OUTLIER * noise {
                *seen = f32::NAN;
            }
            *light = *stray;
        }
        if let Some(halo) = &view.halo {
            for (n, light) in window.light.iter_mut().enumerate() {
                *light += halo[(low[1] + n / window.columns) * size[0] + low[0] + n % window.columns];
            }
        }
        Ok((!particles.is_empty()).then_some(Self { cameras: own, window, particles, free }))
    }

    /// Fits shape and particles. A step below `enough_px` pixels is the last.
    pub(crate) fn fit(mut self, enough_px: f64) -> Result<FoundShape, Refusal> {
        let mut buffers = FitBuffers::default();
        let mut state = self.state(&self.cameras, 1, &mut buffers)?;
        let mut damping = DAMPING;
        let mut std = [f64::INFINITY; SHAPES];
        let mut is_settled = false;
        for _ in 0..STEPS {
            let Step { shape: step, moves, std: found } = self.step(&state, damping, &mut buffers);
            if !step.iter().all(|step| step.is_finite()) {
                damping *= MORE;
                continue;
            }
            std = found;

            // Take the step, with a model of the new shape.
            let view = self.cameras.first();
            let next_cameras = Cameras { views: vec![view.reshaped(view.shape.moved(step), view.depth_mm)?] };
            let old = self.particles.clone();
            self.particles = old.iter().zip(&moves).map(|(one, step)| next_cameras.moved(one, step)).collect();
            let next = self.state(&next_cameras, 1, &mut buffers)?;
            let gain = state.deviance - next.deviance;
            is_settled = step.iter().zip(&std).all(|(step, std)| step.abs() <= enough_px.max(ENOUGH * std));

            // Keep a step that helps. Otherwise, try a shorter one.
            if gain > 0.0 {
                (self.cameras, state) = (next_cameras, next);
                damping = (damping * LESS).max(LEAST_DAMPING);
            } else {
                self.particles = old;
                damping *= MORE;
            }
            if is_settled || damping > MOST_DAMPING {
                break;
            }
        }
        Ok(FoundShape { shape: self.cameras.first().shape, std_px: std, is_settled })
    }

    /// Renders the particles. Slopes by the camera's parameters are those of one particle in `every`.
    pub(super) fn state(&self, cameras: &Cameras, every: usize, buffers: &mut FitBuffers) -> Result<State, Refusal> {
        let mut by_shape = vec![[0f32; SHAPES]; self.window.seen.len()];
        let mut images = Vec::with_capacity(self.particles.len());
        for particles in self.particles.chunks(AT_ONCE) {
            let rendered: Vec<(ParticleImage, Vec<Slopes>)> = particles
                .par_iter()
                .map_init(Scratch::default, |scratch, particle| {
                    ParticleImage::with_slopes(cameras, particle, &self.window, scratch)
                })
                .collect();
            for (image, pixels) in rendered {
                for (n, slopes) in pixels {
                    (0..ANALYTIC).for_each(|k| by_shape[n as usize][k] += slopes[k]);
                }
                images.push(image);
            }
        }
        if self.free.lens.contains(&true) {
            self.add_lens_slopes(cameras, every, &mut by_shape)?;
        }
        let deviance = cameras.deviance(&self.window, images.iter(), buffers);
        Ok(State { images, by_shape, deviance })
    }

    /// Adds the slopes by the camera's free parameters: one step of each to either side. Both lights come on one road,
    /// by bent rays or by straight ones, whose images differ by more than a step changes them.
    fn add_lens_slopes(&self, cameras: &Cameras, every: usize, by_shape: &mut [[f32; SHAPES]]) -> Result<(), Refusal> {
        let view = cameras.first();
        let particles: Vec<&Particle> = self.particles.iter().step_by(every).collect();
        for k in (ANALYTIC..SHAPES).filter(|k| self.free.lens[k - ANALYTIC]) {
            let light = |step_px: f64| {
                let mut step = [0.0; SHAPES];
                step[k] = step_px;
                let moved = view.reshaped(view.shape.moved(step), view.depth_mm)?;
                Ok::<_, Refusal>(self.light(&particles, &Cameras { views: vec![moved] }))
            };
            let (before, after) = (light(-SLOPE_PX)?, light(SLOPE_PX)?);
            for ((slopes, before), after) in by_shape.iter_mut().zip(before).zip(after) {
                slopes[k] = (after - before) / (2.0 * SLOPE_PX) as f32;
            }
        }
        Ok(())
    }

    /// The light of particles in the window.
    fn light(&self, particles: &[&Particle], cameras: &Cameras) -> Vec<f32> {
        let mut light = vec![0f32; self.window.seen.len()];
        let render = |scratch: &mut _, particle: &&_| ParticleImage::light(cameras, particle, &self.window, scratch);
        for particles in particles.chunks(AT_ONCE) {
            let images: Vec<ParticleImage> = particles.par_iter().map_init(Scratch::default, render).collect();
            images.iter().for_each(|image| image.add_to(&mut light, self.window.columns, 1.0));
        }
        light
    }

    /// The step of the shape and those of the particles.
    fn step(&self, state: &State, damping: f64, buffers: &mut FitBuffers) -> Step {
        let Equations { right, reduced, own, solved, .. } = self.equations(state, damping, buffers);
        let view = self.cameras.first();
        let (step, std) = shape_step(&view.shape, self.free.shapes(&view.shape), &right, &reduced);
        let moves = (0..own.len())
            .map(|n| std::array::from_fn(|k| own[n][k] - (0..SHAPES).map(|a| solved[a][n][k] * step[a]).sum::<f64>()))
            .collect();
        Step { shape: step, moves, std }
    }

    /// Equations of the shape bordered by the particles', from which the particles are eliminated.
    pub(super) fn equations(&self, state: &State, damping: f64, buffers: &mut FitBuffers) -> Equations {
        let columns = self.window.columns;
        buffers.paint(state.images.iter(), columns);
        self.cameras.weigh(&self.window, buffers);
        let normal = Normal::new(state.images.iter(), columns, buffers);
        // Sum up the equations of the shape, and those that mix it with each particle.
        let mut matrix = [[0f64; SHAPES]; SHAPES];
        let mut gradient = [0f64; SHAPES];
        let mut squares = 0.0;
        for n in &buffers.touched {
            let n = *n as usize;
            let (slopes, weight) = (state.by_shape[n].map(f64::from), f64::from(buffers.weight[n]));
            let weighed = f64::from(buffers.residual[n]);
            if weight > 0.0 {
                squares += weighed * weighed / weight;
            }
            for a in 0..SHAPES {
                gradient[a] += slopes[a] * weighed;
                (0..SHAPES).for_each(|b| matrix[a][b] += weight * slopes[a] * slopes[b]);
            }
        }
        let is_free = self.free.shapes(&self.cameras.first().shape);
        let none = || vec![[0.0; UNKNOWNS]; state.images.len()];
        let mixed: [Vec<[f64; UNKNOWNS]>; SHAPES] =
            std::array::from_fn(|a| if is_free[a] { self.mixed(state, a, buffers) } else { none() });
        // Eliminate the particles.
        let own = conjugate_gradients(&normal, &normal.gradient, damping, DEEP);
        // Unfinished solutions make the shape's steps shorter, never longer.
        let solved: [Vec<[f64; UNKNOWNS]>; SHAPES] = std::array::from_fn(|a| match is_free[a] {
            true => conjugate_gradients(&normal, &mixed[a], damping, DEEP),
            false => none(),
        });
        buffers.wipe();
        let right = std::array::from_fn(|a| gradient[a] - dot(&mixed[a], &own));
        let reduced = std::array::from_fn(|a| std::array::from_fn(|b| matrix[a][b] - dot(&mixed[a], &solved[b])));
        Equations { right, reduced, own, solved, squares }
    }

    /// Products of the slopes of each pixel's counts by a shared unknown with the derivatives of each particle.
    fn mixed(&self, state: &State, unknown: usize, buffers: &FitBuffers) -> Vec<[f64; UNKNOWNS]> {
        let weighed = |n: usize| buffers.weight[n] * state.by_shape[n][unknown];
        state.images.iter().map(|image| image.products(self.window.columns, weighed)).collect()
    }
}

/// The step of the free unknowns of a shape and their standard uncertainties, by equations from which the particles are
/// eliminated. An unknown that would leave its range is held for this step.
fn shape_step(
    shape: &Shape,
    mut is_free: [bool; SHAPES],
    right: &[f64; SHAPES],
    reduced: &[[f64; SHAPES]; SHAPES],
) -> ([f64; SHAPES], [f64; SHAPES]) {
    loop {
        let (system, mut step) = solved(is_free, right, reduced);
        // Move the particles along with the step that is taken.
        step.iter_mut().for_each(|step| *step = step.clamp(-STEP_PX, STEP_PX));
        let beyond = shape.beyond_range(step);
        if !beyond.contains(&true) {
            let std = std::array::from_fn(|a| {
                let variance = inverse_column(&system, SHAPES, a)[a];
                if is_free[a] { variance.sqrt() } else { 0.0 }
            });
            return (step, std);
        }
        (0..SHAPES).for_each(|k| is_free[k] &= !beyond[k]);
    }
}

/// The factored equations of the free unknowns, and their solution.
fn solved(
    is_free: [bool; SHAPES],
    right: &[f64; SHAPES],
    reduced: &[[f64; SHAPES]; SHAPES],
) -> ([f64; SHAPES * SHAPES], [f64; SHAPES]) {
    let mut system = [0f64; SHAPES * SHAPES];
    let mut step = [0f64; SHAPES];
    for a in 0..SHAPES {
        step[a] = if is_free[a] { right[a] } else { 0.0 };
        for b in 0..SHAPES {
            system[a * SHAPES + b] = match (is_free[a] && is_free[b], a == b) {
                (true, _) => reduced[a][b],
                (false, true) => 1.0,
                (false, false) => 0.0,
            };
        }
    }
    cholesky(&mut system, SHAPES);
    solve(&system, &mut step);
    (system, step)
}

impl Equations {
    /// The fall of the squares that the free unknowns foresee.
    pub(super) fn fall(&self, is_free: [bool; SHAPES]) -> f64 {
        let (_, step) = solved(is_free, &self.right, &self.reduced);
        (0..SHAPES).filter(|k| is_free[*k]).map(|k| self.right[k] * step[k]).sum()
    }
}

/// A step of the shape, those of the particles, and the standard uncertainties of the shape.
struct Step {
    shape: [f64; SHAPES],
    moves: Vec<[f64; UNKNOWNS]>,
    std: [f64; SHAPES],
}

/// Equations of the shape.
pub(super) struct Equations {
    /// Right-hand side, and matrix.
    right: [f64; SHAPES],
    reduced: [[f64; SHAPES]; SHAPES],
    /// The particles' own steps, and those with a step of each unknown of the shape.
    own: Vec<[f64; UNKNOWNS]>,
    solved: [Vec<[f64; UNKNOWNS]>; SHAPES],
    /// Sum of the squared differences over variances.
    pub(super) squares: f64,
}

/// A rendered sample.
pub(super) struct State {
    images: Vec<ParticleImage>,
    /// Derivatives of each pixel's counts by the shape.
    by_shape: Vec<[f32; SHAPES]>,
    deviance: f64,
}
