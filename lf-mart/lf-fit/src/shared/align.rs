//! The unknowns that all particles share in a further camera: its light over the first camera's, and its pose.
//!
//! Each particle's place and light are free along with them. A pose is known only against the other cameras: a particle
//! says something about it only through the difference between this camera and all cameras together.

use crate::cameras::view::{CameraView, Cameras};
use crate::model::buffers::FitBuffers;
use crate::model::particle_image::{COUNTS, ParticleImage, UNKNOWNS};
use crate::model::window::Window;
use crate::search::particles::Particles;
use crate::solve::covariance::Prior;
use crate::solve::normal::cholesky;
use glam::{DMat3, DQuat, DVec3};
use lf_core::linear::{inverse_column, solve};
use rayon::prelude::*;

/// Unknowns of a further camera: the logarithm of its light, a turn about the axes of its frame, rad, and a shift along
/// them, pixels of the first camera's focal plane.
const UNKNOWN: usize = 7;
/// A match is rejected if its brightness here differs from the expected one by more than this fraction.
const MOST_OFF: f64 = 0.5;
/// Smallest number of particles that determine a pose.
const LEAST: usize = 12;
/// Errors of the images of particles look like shifts of this size along the axes of a camera, px. They are added to
/// the stated uncertainties of a pose.
const MODEL_PX: [f64; 3] = [0.01, 0.01, 0.07];
/// Longest step of the light's logarithm.
const LIGHT_STEP: f64 = 0.3;

type Vector = [f64; UNKNOWNS];
type Matrix = [[f64; UNKNOWNS]; UNKNOWNS];

/// The Fisher matrix and the gradient of a particle by the pixels of one camera.
#[derive(Debug, Clone, Copy, Default)]
struct Information {
    fisher: Matrix,
    gradient: Vector,
}

/// A particle's place, mm, and its information by camera.
struct Seen {
    place_mm: [f64; 3],
    by_camera: Vec<Information>,
}

/// Fits the light and, if it `moves`, the pose of each further camera in turn. The particles follow.
pub(crate) fn align(particles: &mut Particles, prior: Prior, moves: bool) {
    for camera in 1..particles.cameras.views.len() {
        let step = step(&gradients(particles), camera, &particles.cameras, prior, moves);
        let pixel_mm = particles.cameras.pixel_mm();
        if let Some(step) = step {
            let view = &mut particles.cameras.views[camera];
            step.take(view, pixel_mm);
            view.pose_std = moves.then(|| step.pose_std(particles.list.iter().map(|one| one.place_mm), pixel_mm));
        }
        particles.summed.forget();
        particles.render();
    }
}

/// The information of all particles.
fn gradients(particles: &Particles) -> Vec<Seen> {
    let plan = particles.plan();
    let tasks: Vec<_> = plan.windows.iter().zip(&plan.members).collect();
    let found: Vec<Vec<Seen>> = tasks
        .par_iter()
        .map_init(FitBuffers::default, |buffers, (rectangles, own)| {
            let window = Window::cut(&particles.cameras.views, rectangles);
            own.iter().map(|n| gradient(particles, *n, &window, buffers)).collect()
        })
        .collect();
    found.into_iter().flatten().collect()
}

/// The information of one particle.
fn gradient(particles: &Particles, n: usize, window: &Window, buffers: &mut FitBuffers) -> Seen {
    let (cameras, particle) = (&particles.cameras, &particles.list[n]);
    let mut by_camera = vec![Information::default(); cameras.views.len()];
    ParticleImage::new(cameras, particle, window, &mut buffers.scratch).pixels(window.columns, |n, by| {
        let (seen, light) = (window.seen[n], window.light[n]);
        if !seen.is_nan() {
            let weight = 1.0 / f64::from(window.noise(cameras, n).variance(light));
            let off = f64::from(seen - light);
            let by = by.map(f64::from);
            let Information { fisher, gradient } = &mut by_camera[window.camera_of(n)];
            for a in 0..UNKNOWNS {
                gradient[a] += weight * off * by[a];
                (0..UNKNOWNS).for_each(|b| fisher[a][b] += weight * by[a] * by[b]);
            }
        }
    });
    Seen { place_mm: particle.place_mm, by_camera }
}

/// A step of a camera's light and pose, and standard uncertainties; 0 for what is held.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    by: [f64; UNKNOWN],
    std: [f64; UNKNOWN],
}

/// The step of a further camera; None if too few particles determine it.
fn step(particles: &[Seen], camera: usize, cameras: &Cameras, prior: Prior, moves: bool) -> Option<Step> {
    // Sum up what the particles that both see say about the camera.
    let mut matrix = [[0f64; UNKNOWN]; UNKNOWN];
    let mut right = [0f64; UNKNOWN];
    let mut each = Vec::new();
    for Seen { place_mm, by_camera } in particles {
        let Information { fisher, gradient } = &by_camera[camera];
        let own = fisher[COUNTS][COUNTS];
        if own <= 0.0 || (gradient[COUNTS] / own).abs() > MOST_OFF {
            continue;
        }
        let rest = schur_complement(by_camera, camera, prior);
        let by = effect(&cameras.views[camera], *place_mm, cameras.pixel_mm());
        let own: [f64; UNKNOWN] = std::array::from_fn(|a| (0..UNKNOWNS).map(|k| by[k][a] * rest.gradient[k]).sum());
        each.push(own);
        for a in 0..UNKNOWN {
            right[a] += own[a];
            let along = |k: usize| (0..UNKNOWNS).map(|n| rest.fisher[k][n] * by[n][a]).sum::<f64>();
            let turned: Vector = std::array::from_fn(along);
            for b in 0..UNKNOWN {
                matrix[b][a] += (0..UNKNOWNS).map(|k| by[k][b] * turned[k]).sum::<f64>();
            }
        }
    }
    if each.len() < LEAST {
        return None;
    }

    // Solve for all unknowns, or for the light alone.
    let size = if moves { UNKNOWN } else { 1 };
    let mut system: Vec<f64> = (0..size * size).map(|n| matrix[n / size][n % size]).collect();
    cholesky(&mut system, size);
    let mut solved = right[..size].to_vec();
    solve(&system, &mut solved);
    let mut step = Step { by: [0.0; UNKNOWN], std: [0.0; UNKNOWN] };
    step.by[..size].copy_from_slice(&solved);
    step.by[0] = step.by[0].clamp(-LIGHT_STEP, LIGHT_STEP);
    // Particles that pull in more different ways than noise lets them know less.
    let inverse: Vec<Vec<f64>> = (0..size).map(|n| inverse_column(&system, size, n)).collect();
    for n in 0..size {
        let pull = |own: &[f64; UNKNOWN]| inverse[n].iter().zip(own).map(|(a, b)| a * b).sum::<f64>();
        let mean = each.iter().map(pull).sum::<f64>() / each.len() as f64;
        let scatter: f64 = each.iter().map(|own| (pull(own) - mean).powi(2)).sum();
        step.std[n] = inverse[n][n].max(scatter).sqrt();
    }
    step.by.iter().all(|value| value.is_finite()).then_some(step)
}

/// A camera's information when the particle follows: `F - F T^-1 F` and `g - F T^-1 t`, T and t those of all cameras.
fn schur_complement(by_camera: &[Information], camera: usize, prior: Prior) -> Information {
    let Information { fisher: own, gradient } = &by_camera[camera];
    let mut total = [0f64; UNKNOWNS * UNKNOWNS];
    let mut sum = [0f64; UNKNOWNS];
    for Information { fisher, gradient } in by_camera {
        (0..UNKNOWNS * UNKNOWNS).for_each(|n| total[n] += fisher[n / UNKNOWNS][n % UNKNOWNS]);
        (0..UNKNOWNS).for_each(|n| sum[n] += gradient[n]);
    }
    (0..UNKNOWNS).for_each(|n| total[n * UNKNOWNS + n] += prior.0[n].powi(-2));
    cholesky(&mut total, UNKNOWNS);
    solve(&total, &mut sum);
    let mut rest = Information { fisher: *own, gradient: *gradient };
    for column in 0..UNKNOWNS {
        let mut solved: Vector = std::array::from_fn(|row| own[row][column]);
        solve(&total, &mut solved);
        (0..UNKNOWNS).for_each(|row| {
            rest.fisher[row][column] -= (0..UNKNOWNS).map(|k| own[row][k] * solved[k]).sum::<f64>();
        });
    }
    (0..UNKNOWNS).for_each(|row| rest.gradient[row] -= (0..UNKNOWNS).map(|k| own[row][k] * sum[k]).sum::<f64>());
    rest
}

/// Derivatives by the camera's unknowns of a particle's place, pixels, and of the logarithm of its light, as the camera
/// sees them.
fn effect(view: &CameraView, place: [f64; 3], pixel_mm: f64) -> [[f64; UNKNOWN]; UNKNOWNS] {
    let back = view.pose.matrix().transpose();
    let there = DVec3::from(view.pose.to_camera(place));
    let mut by = [[0.0; UNKNOWN]; UNKNOWNS];
    by[COUNTS][0] = 1.0;
    for (n, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        let (turned, shifted) = (back * axis.cross(there) / pixel_mm, back * axis);
        for k in 0..3 {
            (by[k][1 + n], by[k][4 + n]) = (turned[k], shifted[k]);
        }
    }
    by
}

impl Step {
    /// Standard uncertainties of the turns, rad, and the shifts, mm, from particles at these places.
    fn pose_std(&self, places_mm: impl Iterator<Item = [f64; 3]> + Clone, pixel_mm: f64) -> ([f64; 3], [f64; 3]) {
        let count = places_mm.clone().count() as f64;
        let mean = places_mm.clone().map(DVec3::from).sum::<DVec3>() / count;
        let square = places_mm.map(|place| (DVec3::from(place) - mean).length_squared()).sum::<f64>() / count;
        let turn = MODEL_PX[0] * pixel_mm / square.sqrt();
        let (turns, shifts) = (&self.std[1..4], &self.std[4..7]);
        (
            std::array::from_fn(|n| turns[n].hypot(turn)),
            std::array::from_fn(|n| shifts[n].hypot(MODEL_PX[n]) * pixel_mm),
        )
    }

    /// Moves the camera.
    fn take(&self, view: &mut CameraView, pixel_mm: f64) {
        let [light, a, b, c, x, y, z] = self.by;
        view.light *= light.exp();
        if self.by[1..] == [0.0; UNKNOWN - 1] {
            return;
        }
        let turn = DQuat::from_scaled_axis(DVec3::new(a, b, c));
        let matrix = DMat3::from_quat((turn * DQuat::from_mat3(&view.pose.matrix())).normalize());
        let shift = turn * DVec3::from(view.pose.translation_mm) + DVec3::new(x, y, z) * pixel_mm;
        let rows = matrix.transpose();
        view.pose.rotation = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.to_array());
        view.pose.translation_mm = shift.to_array();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cameras::view::tests::{ASIDE, PIXEL_MM, Sight, view};
    use crate::particle::Particle;
    use lf_core::camera::Pose;
    use ndarray::ArcArray2;

    fn particles<'a>(first: &'a Sight, further: &CameraView<'a>, list: &[Particle]) -> Particles<'a> {
        let views = vec![view(first, Pose::default(), 1.0), further.clone()];
        Particles { reach_px: 120, beside_px: 28.0, ..Particles::new(Cameras { views }, list.to_vec()).unwrap() }
    }

    /// Forty particles at their true places. The pose of the second camera is off by 0.3 mrad and some tenths of a
    /// pixel, its light by a tenth: both come back.
    #[test]
    fn light_and_pose_of_a_camera_come_back() {
        let sights = [Sight::new(30), Sight::new(30)];
        let mut truth = view(&sights[1], ASIDE, 0.8);
        let by = [0.0, 2e-4, -3e-4, 1e-4, 0.2, -0.3, 0.4];
        Step { by, std: [0.0; UNKNOWN] }.take(&mut truth, PIXEL_MM);
        let place = |n: usize| {
            let part = |by: f64| (n as f64 * by).fract() - 0.5;
            [0.9 * part(0.618_034), 0.9 * part(0.754_878), 1.6 * part(0.569_840)]
        };
        let list: Vec<Particle> = (0..40).map(|n| Particle::new(place(n), 1e5)).collect();
        let mut rendered = particles(&sights[0], &truth, &list);
        rendered.render();
        let images =
            [0, 1].map(|n| ArcArray2::from_shape_vec((420, 420), rendered.cameras.views[n].expected.clone()).unwrap());
        let mut found = view(&sights[1], ASIDE, 0.72);
        for _ in 0..5 {
            let mut particles = particles(&sights[0], &found, &list);
            particles.cameras.views.iter_mut().zip(&images).for_each(|(view, image)| view.image = image.clone());
            particles.render();
            let prior = Prior([14.0, 14.0, 1000.0, 1.0]);
            step(&gradients(&particles), 1, &particles.cameras, prior, true).unwrap().take(&mut found, PIXEL_MM);
        }
        assert!((found.light / 0.8 - 1.0).abs() < 1e-3, "{}", found.light);
        for particle in &list {
            let off = |k: usize| (found.seen(particle).place_mm[k] - truth.seen(particle).place_mm[k]) / PIXEL_MM;
            assert!((0..2).all(|k| off(k).abs() < 0.02) && off(2).abs() < 0.1, "{:?}", [off(0), off(1), off(2)]);
        }
    }
}
