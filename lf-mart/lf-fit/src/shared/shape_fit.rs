//! Fits the unknowns that all particles share: their size, the drift of the lattice, the blur. The particles that parts
//! of one camera's sensor see are fitted along with them.

use super::sample::{Sample, SamplePart};
use crate::cameras::lens::lens;
use crate::cameras::shape::{ANALYTIC, SHAPES, Shape};
use crate::cameras::view::{CameraView, Cameras};
use crate::model::buffers::FitBuffers;
use crate::model::particle_image::{ParticleImage, Slopes, UNKNOWNS};
use crate::particle::Particle;
use crate::solve::joint::{DAMPING, LEAST_DAMPING, LESS, MORE};
use crate::solve::normal::{CgLimits, DEEP, Normal, cholesky, conjugate_gradients, dot};
use glam::DVec2;
use lf_core::Refusal;
use lf_core::linear::{inverse_column, solve};
use lf_core::particle_image::Scratch;
use rayon::prelude::*;

/// Particles that are rendered before their derivatives are added up; bounds the memory.
const AT_ONCE: usize = 64;
/// Longest step, pixels.
const STEP_PX: f64 = 0.1;
/// Largest number of shorter steps, and of all steps: particles of a wrong camera lead beyond its truth, and later fits
/// follow a larger error to its end.
const STEPS: usize = 10;
const ALL_STEPS: usize = 40;
/// The fit ends if a step needs more damping than this.
const MOST_DAMPING: f64 = 10.0;
/// The fit ends if every unknown moves by less than this share of its uncertainty.
const ENOUGH: f64 = 0.2;
/// Distance, to either side, of the shapes whose lights give the slopes by a camera's parameter, pixels.
const SLOPE_PX: f64 = 0.015;
/// The slopes by the drift among those of the shape.
const DRIFT: [usize; 2] = [1, 2];

/// The result of a fit of the shape.
pub(crate) struct FoundShape {
    pub(crate) shape: Shape,
    /// Standard uncertainties of the size and of both drifts, pixels.
    pub(crate) std_px: [f64; SHAPES],
    /// The particles as they follow it, with their places in the list of all.
    pub(crate) particles: Vec<(usize, Particle)>,
    /// Whether the last step was below the uncertainty.
    pub(crate) is_settled: bool,
}

impl Sample<'_> {
    /// Fits shape and particles. A step below `enough_px` pixels is the last.
    pub(crate) fn fit(mut self, enough_px: f64) -> Result<FoundShape, Refusal> {
        Ok(self.find(enough_px)?.0)
    }

    /// Mean squared difference over variance where light is expected, after one step of shape and particles.
    pub(crate) fn misfit_after_step(mut self) -> Result<f64, Refusal> {
        let (_, state) = self.find(STEP_PX)?;
        let (view, each) = (self.cameras.first(), self.parts.iter().zip(&state.parts));
        let squares: Vec<f64> = each.flat_map(|(part, state)| part.squares(view, state)).collect();
        Ok(squares.iter().sum::<f64>() / squares.len().max(1) as f64)
    }

    /// Fits like [`Self::fit`]. Gives the rendered sample too.
    fn find(&mut self, enough_px: f64) -> Result<(FoundShape, State), Refusal> {
        let mut buffers = FitBuffers::default();
        let mut state = self.state(&self.cameras, 1, &mut buffers)?;
        let mut damping = DAMPING;
        let mut std = [f64::INFINITY; SHAPES];
        let mut is_settled = false;
        let mut shorter = 0;
        for _ in 0..ALL_STEPS {
            let Step { shape: step, moves, std: found } = self.step(&state, damping, &mut buffers);
            shorter += usize::from(!step.iter().any(|step| step.abs() == STEP_PX));
            if !step.iter().all(|step| step.is_finite()) {
                damping *= MORE;
                continue;
            }
            std = found;

            // Take the step, with a model of the new shape.
            let view = self.cameras.first();
            let next_cameras = Cameras { views: vec![view.reshaped(view.shape.moved(step), view.depth_mm)?] };
            let mut old = Vec::with_capacity(self.parts.len());
            for (part, moves) in self.parts.iter_mut().zip(&moves) {
                let moved = part.particles.iter().zip(moves).map(|(one, step)| next_cameras.moved(one, step)).collect();
                old.push(std::mem::replace(&mut part.particles, moved));
            }
            let mut next = self.state(&next_cameras, 1, &mut buffers)?;
            let gain = state.deviance - next.deviance;
            is_settled = step.iter().zip(&std).all(|(step, std)| step.abs() <= enough_px.max(ENOUGH * std));

            // Keep a step that helps. Otherwise, try a shorter one.
            if gain > 0.0 {
                std::mem::swap(&mut state, &mut next);
                self.cameras = next_cameras;
                damping = (damping * LESS).max(LEAST_DAMPING);
            } else {
                self.parts.iter_mut().zip(old).for_each(|(part, old)| part.particles = old);
                damping *= MORE;
            }
            buffers.spare.extend(next.parts.into_iter().rev().map(|part| part.by_shape));
            if is_settled || damping > MOST_DAMPING || shorter == STEPS {
                break;
            }
        }
        let moved = self.parts.iter().flat_map(|part| part.places.iter().copied().zip(part.particles.iter().copied()));
        Ok((
            FoundShape { shape: self.cameras.first().shape, std_px: std, particles: moved.collect(), is_settled },
            state,
        ))
    }

    /// Renders the particles. Slopes by parameters of the camera are those of one particle in `every`, if they do not
    /// follow from the drift.
    pub(super) fn state(&self, cameras: &Cameras, every: usize, buffers: &mut FitBuffers) -> Result<State, Refusal> {
        let mut parts: Vec<PartState> = self.parts.iter().map(|part| part.state(cameras, buffers)).collect();
        if self.free.lens.contains(&true) {
            self.add_lens_slopes(cameras, every, &mut parts)?;
        }
        let each = self.parts.iter().zip(&parts);
        let deviance = each.map(|(part, state)| cameras.deviance(&part.window, state.images.iter(), buffers)).sum();
        Ok(State { parts, deviance })
    }

    /// Adds the slopes by the camera's free parameters: those by the drift, as far as lenslets move, or a step of each
    /// to either side. Both lights come on one road, by bent rays or by straight ones, whose images differ by more
    /// than a step changes them.
    fn add_lens_slopes(&self, cameras: &Cameras, every: usize, states: &mut [PartState]) -> Result<(), Refusal> {
        let view = cameras.first();
        let middle = 0.5 * DVec2::from(view.size().map(|size| size as f64));
        for k in (ANALYTIC..SHAPES).filter(|k| self.free.lens[k - ANALYTIC]) {
            if lens(k - ANALYTIC).shift_px(view.camera, DVec2::ZERO).is_some() {
                for (part, state) in self.parts.iter().zip(states.iter_mut()) {
                    for (n, slopes) in state.by_shape.iter_mut().enumerate() {
                        let shift = lens(k - ANALYTIC).shift_px(view.camera, part.place_px(n) - middle);
                        let [x, y] = shift.unwrap_or_default().as_vec2().to_array();
                        slopes[k] = x * slopes[DRIFT[0]] + y * slopes[DRIFT[1]];
                    }
                }
                continue;
            }
            let stepped = |step_px: f64| {
                let mut step = [0.0; SHAPES];
                step[k] = step_px;
                let moved = view.reshaped(view.shape.moved(step), view.depth_mm)?;
                Ok::<_, Refusal>(Cameras { views: vec![moved] })
            };
            let (before, after) = (stepped(-SLOPE_PX)?, stepped(SLOPE_PX)?);
            for (part, state) in self.parts.iter().zip(states.iter_mut()) {
                let pairs = part.light(every, &before).into_iter().zip(part.light(every, &after));
                for (slopes, (before, after)) in state.by_shape.iter_mut().zip(pairs) {
                    slopes[k] = (after - before) / (2.0 * SLOPE_PX) as f32;
                }
            }
        }
        Ok(())
    }

    /// The step of the shape and those of the particles.
    fn step(&self, state: &State, damping: f64, buffers: &mut FitBuffers) -> Step {
        let Equations { right, reduced, particles, .. } = self.equations(state, (damping, DEEP), buffers);
        let view = self.cameras.first();
        let (step, std) = shape_step(&view.shape, self.free.shapes(&view.shape), &right, &reduced);
        let moves = particles.iter().map(|solutions| solutions.steps(step)).collect();
        Step { shape: step, moves, std }
    }

    /// Equations of the shape bordered by the particles', from which the particles are eliminated.
    pub(super) fn equations(&self, state: &State, damping: (f64, CgLimits), buffers: &mut FitBuffers) -> Equations {
        let is_free = self.free.shapes(&self.cameras.first().shape);
        let mut sum = Equations::default();
        for (part, state) in self.parts.iter().zip(&state.parts) {
            part.add_equations(&self.cameras, state, is_free, damping, buffers, &mut sum);
        }
        // Sums have the lower triangle.
        (0..SHAPES).for_each(|a| (0..a).for_each(|b| sum.reduced[b][a] = sum.reduced[a][b]));
        sum
    }
}

impl SamplePart {
    /// The place of a pixel of the window on the sensor, px.
    fn place_px(&self, n: usize) -> DVec2 {
        let (part, columns) = (self.window.parts[0], self.window.columns);
        DVec2::new((part.left + n % columns) as f64 + 0.5, (part.top + n / columns) as f64 + 0.5)
    }

    /// Renders the particles, with the slopes that the model has.
    fn state(&self, cameras: &Cameras, buffers: &mut FitBuffers) -> PartState {
        let mut by_shape = buffers.spare.pop().unwrap_or_default();
        by_shape.clear();
        by_shape.resize(self.window.seen.len(), [0.0; SHAPES]);
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
        PartState { images, by_shape }
    }

    /// Squared differences over variances where light is expected.
    fn squares(&self, view: &CameraView, state: &PartState) -> Vec<f64> {
        let mut expected = self.window.light.clone();
        state.images.iter().for_each(|image| image.add_to(&mut expected, self.window.columns, 1.0));
        let pixels =
            self.window.seen.iter().zip(&expected).map(|(seen, light)| view.difference(*seen, *light, view.lit()));
        pixels.filter(|difference| !difference.is_nan()).map(|difference| f64::from(difference).powi(2)).collect()
    }

    /// The light of one particle in `every` in the window.
    fn light(&self, every: usize, cameras: &Cameras) -> Vec<f32> {
        let mut light = vec![0f32; self.window.seen.len()];
        let particles: Vec<_> = self.particles.iter().step_by(every).collect();
        let render = |scratch: &mut _, particle: &&_| ParticleImage::light(cameras, particle, &self.window, scratch);
        for particles in particles.chunks(AT_ONCE) {
            let images: Vec<ParticleImage> = particles.par_iter().map_init(Scratch::default, render).collect();
            images.iter().for_each(|image| image.add_to(&mut light, self.window.columns, 1.0));
        }
        light
    }

    /// Adds the part's equations to a sum.
    fn add_equations(
        &self,
        cameras: &Cameras,
        state: &PartState,
        is_free: [bool; SHAPES],
        (damping, limits): (f64, CgLimits),
        buffers: &mut FitBuffers,
        sum: &mut Equations,
    ) {
        let columns = self.window.columns;
        buffers.fit(self.window.seen.len());
        buffers.paint(state.images.iter(), columns);
        cameras.weigh(&self.window, buffers);
        let normal = Normal::new(state.images.iter(), columns, buffers);
        // Sum up the equations of the shape, and those that mix it with each particle.
        for n in &buffers.touched {
            let n = *n as usize;
            let (slopes, weight) = (state.by_shape[n].map(f64::from), f64::from(buffers.weight[n]));
            let weighed = f64::from(buffers.residual[n]);
            if weight > 0.0 {
                sum.squares += weighed * weighed / weight;
            }
            for a in (0..SHAPES).filter(|a| is_free[*a]) {
                sum.right[a] += slopes[a] * weighed;
                (0..=a).for_each(|b| sum.reduced[a][b] += weight * slopes[a] * slopes[b]);
            }
        }
        // Eliminate the particles. Unfinished solutions make the shape's steps shorter, never longer.
        let free: Vec<usize> = (0..SHAPES).filter(|a| is_free[*a]).collect();
        let mixed: Vec<Vec<_>> = free.par_iter().map(|a| self.mixed(state, *a, buffers)).collect();
        let solve = |right: &Vec<_>| conjugate_gradients(&normal, right, damping, limits);
        let (own, solved): (_, Vec<Vec<_>>) =
            rayon::join(|| solve(&normal.gradient), || mixed.par_iter().map(solve).collect());
        buffers.wipe();
        for (n, a) in free.iter().enumerate() {
            sum.right[*a] -= dot(&mixed[n], &own);
            (0..=n).for_each(|m| sum.reduced[*a][free[m]] -= dot(&mixed[n], &solved[m]));
        }
        sum.particles.push(Solutions { own, solved: free.into_iter().zip(solved).collect() });
    }

    /// Products of the slopes of each pixel's counts by a shared unknown with the derivatives of each particle.
    fn mixed(&self, state: &PartState, unknown: usize, buffers: &FitBuffers) -> Vec<[f64; UNKNOWNS]> {
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
    /// The step of the free unknowns, and the fall of the squares that it foresees.
    pub(super) fn foreseen(&self, is_free: [bool; SHAPES]) -> ([f64; SHAPES], f64) {
        let (_, step) = solved(is_free, &self.right, &self.reduced);
        (step, (0..SHAPES).filter(|k| is_free[*k]).map(|k| self.right[k] * step[k]).sum())
    }
}

/// A step of the shape, those of the particles of each part, and the standard uncertainties of the shape.
struct Step {
    shape: [f64; SHAPES],
    moves: Vec<Vec<[f64; UNKNOWNS]>>,
    std: [f64; SHAPES],
}

/// Equations of the shape.
#[derive(Default)]
pub(super) struct Equations {
    /// Right-hand side, and matrix.
    pub(super) right: [f64; SHAPES],
    pub(super) reduced: [[f64; SHAPES]; SHAPES],
    /// The solutions of each part's particles.
    particles: Vec<Solutions>,
    /// Sum of the squared differences over variances.
    pub(super) squares: f64,
}

/// The own steps of particles, and those with a step of each free unknown of the shape.
struct Solutions {
    own: Vec<[f64; UNKNOWNS]>,
    solved: Vec<(usize, Vec<[f64; UNKNOWNS]>)>,
}

impl Solutions {
    /// The steps of the particles beside one of the shape.
    fn steps(&self, shape: [f64; SHAPES]) -> Vec<[f64; UNKNOWNS]> {
        let along = |n: usize, k: usize| self.solved.iter().map(|(a, moves)| moves[n][k] * shape[*a]).sum::<f64>();
        (0..self.own.len()).map(|n| std::array::from_fn(|k| self.own[n][k] - along(n, k))).collect()
    }
}

/// A rendered sample.
pub(super) struct State {
    parts: Vec<PartState>,
    deviance: f64,
}

/// A rendered part.
struct PartState {
    images: Vec<ParticleImage>,
    /// Derivatives of each pixel's counts by the shape.
    by_shape: Vec<[f32; SHAPES]>,
}
