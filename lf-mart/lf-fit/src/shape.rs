//! The unknowns that all particles share: their size, and the drift of the camera's lattice. Both are fitted together
//! with the particles of a part of the sensor.

use super::buffers::Buffers;
use super::image::{SpotImage, UNKNOWNS};
use super::joint::Setting;
use super::normal::{DEEP, Normal, cholesky, conjugate_gradients, solve};
use super::{spot::Spot, window::Window};
use lf_core::particle_image::{ParticleModel, Patch, QUANTITIES, Scratch};
use lf_core::{Camera, Refusal};
use rayon::prelude::*;

/// Size and drift, pixels: of the focal plane, and of the sensor along its columns and rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Standard deviation of a particle, pixels of the focal plane.
    pub sigma_px: f64,
    /// Shift of the lattice against the camera's, pixels.
    pub drift_px: [f64; 2],
}

/// Which parts of a shape are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Free {
    /// The size.
    pub size: bool,
    /// The drift.
    pub drift: bool,
}

/// Particles that are rendered before their derivatives are added up; bounds the memory.
const AT_ONCE: usize = 64;
/// Unknowns of a shape.
const SHAPES: usize = 3;
/// Longest step, pixels; the least size.
const STEP_PX: f64 = 0.1;
const LEAST_PX: f64 = 0.15;
const MOST_PX: f64 = 5.0;
/// Damping of the particles while the shape is fitted: its start, its change after a good and after a bad step.
const DAMPING: f64 = 0.01;
const LESS: f64 = 0.2;
const MORE: f64 = 8.0;
const LEAST_DAMPING: f64 = 1e-6;
/// Steps that ask for more damping do not help.
const MOST_DAMPING: f64 = 10.0;
/// A step of every unknown by less than this share of its uncertainty ends the fit.
const ENOUGH: f64 = 0.2;

impl Shape {
    /// The model of particles of this shape.
    pub(super) fn model(&self, camera: &Camera, depth_mm: [f64; 2]) -> Result<ParticleModel, Refusal> {
        ParticleModel::new(&self.camera(camera), self.sigma_px * camera.pixel_in_focus_mm(), depth_mm)
    }

    /// The camera with its lattice where it is found.
    pub fn camera(&self, camera: &Camera) -> Camera {
        let mut moved = camera.clone();
        for (axis, offset) in moved.microlenses.offset_mm.iter_mut().enumerate() {
            *offset += self.drift_px[axis] * camera.sensor.pixel_pitch_mm;
        }
        moved
    }

    /// Whether a part differs from another shape's by more than its standard uncertainty.
    pub(super) fn is_beyond(&self, other: &Self, [size, x, y]: [f64; SHAPES]) -> bool {
        (self.sigma_px - other.sigma_px).abs() > size
            || (self.drift_px[0] - other.drift_px[0]).abs() > x
            || (self.drift_px[1] - other.drift_px[1]).abs() > y
    }

    fn moved(&self, step: [f64; SHAPES]) -> Self {
        let [size, x, y] = step;
        let sigma_px = (self.sigma_px + size).clamp(LEAST_PX, MOST_PX);
        Self { sigma_px, drift_px: [self.drift_px[0] + x, self.drift_px[1] + y] }
    }
}

/// The result of a fit of the shape.
pub(super) struct FoundShape {
    pub(super) shape: Shape,
    /// Standard uncertainties of the size and of both drifts, pixels.
    pub(super) std_px: [f64; SHAPES],
    /// Whether the last step was below the uncertainty.
    pub(super) is_settled: bool,
}

/// A part of the sensor and the particles that it sees. Pixels of the window that are not to tell the shape are blind;
/// its light is that of particles that are held.
pub(super) struct Sample<'a> {
    pub(super) camera: &'a Camera,
    pub(super) window: Window,
    pub(super) spots: Vec<Spot>,
    pub(super) free: Free,
}

impl Sample<'_> {
    /// Fits shape and particles.
    pub(super) fn fit(&mut self, setting: &Setting, mut shape: Shape, steps: usize) -> Result<FoundShape, Refusal> {
        let mut buffers = Buffers::default();
        let mut model = shape.model(self.camera, setting.depth_mm)?;
        let mut state = self.state(&Setting { model: &model, ..*setting }, &mut buffers);
        let mut damping = DAMPING;
        let mut std = [f64::INFINITY; SHAPES];
        let mut is_settled = false;
        for _ in 0..steps {
            let Step { shape: step, moves, std: found } =
                self.step(&Setting { model: &model, ..*setting }, &state, damping, &mut buffers);
            if !step.iter().all(|step| step.is_finite()) {
                damping *= MORE;
                continue;
            }
            std = found;
            let next_shape = shape.moved(step);
            let next_model = next_shape.model(self.camera, setting.depth_mm)?;
            let next_setting = Setting { model: &next_model, ..*setting };
            let old = self.spots.clone();
            self.spots = old.iter().zip(&moves).map(|(spot, step)| next_setting.moved(spot, step)).collect();
            let next = self.state(&next_setting, &mut buffers);
            let gain = state.deviance - next.deviance;
            is_settled = step.iter().zip(&std).all(|(step, std)| step.abs() <= ENOUGH * std);
            if gain > 0.0 {
                (shape, model, state) = (next_shape, next_model, next);
                damping = (damping * LESS).max(LEAST_DAMPING);
            } else {
                self.spots = old;
                damping *= MORE;
            }
            if is_settled || damping > MOST_DAMPING {
                break;
            }
        }
        Ok(FoundShape { shape, std_px: std, is_settled })
    }

    /// Renders the particles.
    fn state(&self, setting: &Setting, buffers: &mut Buffers) -> State {
        let mut by_shape = vec![[0f32; SHAPES]; self.window.seen.len()];
        let mut images = Vec::with_capacity(self.spots.len());
        for spots in self.spots.chunks(AT_ONCE) {
            let rendered: Vec<(SpotImage, Vec<Slopes>)> = spots
                .par_iter()
                .map_init(Scratch::default, |scratch, spot| self.render(setting, spot, scratch))
                .collect();
            for (image, pixels) in rendered {
                for (n, slopes) in pixels {
                    (0..SHAPES).for_each(|k| by_shape[n as usize][k] += slopes[k]);
                }
                images.push(image);
            }
        }
        let deviance = setting.deviance(&self.window, images.iter(), buffers);
        State { images, by_shape, deviance }
    }

    /// The image of a particle, and the derivatives of its counts by the shape, by pixel of the window.
    fn render(&self, setting: &Setting, spot: &Spot, scratch: &mut Scratch) -> (SpotImage, Vec<Slopes>) {
        let Window { left, top, columns, rows, .. } = self.window;
        let sensor_px = spot.light * self.camera.sensor.pixel_pitch_mm;
        let scale = [spot.light * setting.pixel_mm, sensor_px, sensor_px];
        let mut slopes = Vec::new();
        let take = |patch: Patch, pixels: &[[f64; QUANTITIES]]| {
            for (n, pixel) in pixels.iter().enumerate() {
                let column = patch.column as usize + n % patch.columns as usize;
                let row = patch.row as usize + n / patch.columns as usize;
                if (left..left + columns).contains(&column) && (top..top + rows).contains(&row) {
                    let at = (row - top) * columns + column - left;
                    slopes.push((at as u32, std::array::from_fn(|k| (scale[k] * pixel[4 + k]) as f32)));
                }
            }
        };
        let image = SpotImage::with_all(setting.model, spot, setting.pixel_mm, &self.window, scratch, take);
        (image, slopes)
    }

    /// The step of the shape and those of the particles: the equations of the shape are bordered by the particles'.
    fn step(&self, setting: &Setting, state: &State, damping: f64, buffers: &mut Buffers) -> Step {
        let columns = self.window.columns;
        buffers.paint(state.images.iter(), columns);
        setting.weigh(&self.window, buffers);
        let normal = Normal::new(state.images.iter(), columns, buffers);
        let mut matrix = [[0f64; SHAPES]; SHAPES];
        let mut gradient = [0f64; SHAPES];
        for n in &buffers.touched {
            let n = *n as usize;
            let slopes = state.by_shape[n].map(f64::from);
            for a in 0..SHAPES {
                gradient[a] += slopes[a] * f64::from(buffers.pull[n]);
                (0..SHAPES).for_each(|b| matrix[a][b] += f64::from(buffers.weight[n]) * slopes[a] * slopes[b]);
            }
        }
        let mixed: [Vec<[f64; UNKNOWNS]>; SHAPES] = std::array::from_fn(|a| self.mixed(state, a, buffers));
        let own = conjugate_gradients(&normal, &normal.gradient, damping, DEEP);
        // Unfinished solutions make the shape's steps shorter, never longer.
        let solved: [Vec<[f64; UNKNOWNS]>; SHAPES] =
            std::array::from_fn(|a| conjugate_gradients(&normal, &mixed[a], damping, DEEP));
        buffers.wipe();
        let dot = |a: &[[f64; UNKNOWNS]], b: &[[f64; UNKNOWNS]]| -> f64 {
            a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum()
        };
        let is_free = [self.free.size, self.free.drift, self.free.drift];
        let mut system = [0f64; SHAPES * SHAPES];
        let mut step = [0f64; SHAPES];
        for a in 0..SHAPES {
            step[a] = if is_free[a] { gradient[a] - dot(&mixed[a], &own) } else { 0.0 };
            for b in 0..SHAPES {
                system[a * SHAPES + b] = match (is_free[a] && is_free[b], a == b) {
                    (true, _) => matrix[a][b] - dot(&mixed[a], &solved[b]),
                    (false, true) => 1.0,
                    (false, false) => 0.0,
                };
            }
        }
        cholesky(&mut system, SHAPES);
        solve(&system, SHAPES, &mut step);
        // The particles move along with the step that is taken.
        step.iter_mut().for_each(|step| *step = step.clamp(-STEP_PX, STEP_PX));
        let std = std::array::from_fn(|a| {
            let mut unit = [0.0; SHAPES];
            unit[a] = 1.0;
            solve(&system, SHAPES, &mut unit);
            if is_free[a] { unit[a].sqrt() } else { 0.0 }
        });
        let moves = (0..own.len())
            .map(|n| std::array::from_fn(|k| own[n][k] - (0..SHAPES).map(|a| solved[a][n][k] * step[a]).sum::<f64>()))
            .collect();
        Step { shape: step, moves, std }
    }

    /// Products of the derivatives by one part of the shape with those of each particle.
    fn mixed(&self, state: &State, part: usize, buffers: &Buffers) -> Vec<[f64; UNKNOWNS]> {
        let one = |image: &SpotImage| {
            let mut sum = [0f64; UNKNOWNS];
            image.pixels(self.window.columns, |n, pixel| {
                let weighed = buffers.weight[n] * state.by_shape[n][part];
                (0..UNKNOWNS).for_each(|k| sum[k] += f64::from(weighed * pixel[k]));
            });
            sum
        };
        state.images.iter().map(one).collect()
    }
}

/// A pixel of the window, and the derivatives of its counts by the shape.
type Slopes = (u32, [f32; SHAPES]);

/// A step of the shape, those of the particles, and the standard uncertainties of the shape.
struct Step {
    shape: [f64; SHAPES],
    moves: Vec<[f64; UNKNOWNS]>,
    std: [f64; SHAPES],
}

/// A rendered sample.
struct State {
    images: Vec<SpotImage>,
    /// Derivatives of each pixel's counts by the shape.
    by_shape: Vec<[f32; SHAPES]>,
    deviance: f64,
}
