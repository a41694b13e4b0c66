//! The unknowns that all particles share in a further camera: its light over the first camera's, and its pose.
//!
//! Each particle's place and light are free along with them. A pose is known only against the other cameras, so a
//! particle tells what this camera asks for beyond what all ask for together.

use super::buffers::Buffers;
use super::cloud::Cloud;
use super::covariance::Prior;
use super::image::UNKNOWNS;
use super::joint::Setting;
use super::normal::{cholesky, solve};
use super::view::View;
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;

/// Unknowns of a further camera: the logarithm of its light, a turn about the axes of its frame, rad, and a shift along
/// them, pixels of the first camera's focal plane.
const UNKNOWN: usize = 7;
/// Particles whose light in this camera is off by more than this share are none that both see.
const MOST_OFF: f64 = 0.5;
/// Fewest particles that tell a pose.
const LEAST: usize = 12;
/// Longest step of the light's logarithm.
const LIGHT_STEP: f64 = 0.3;

type Vector = [f64; UNKNOWNS];
type Matrix = [[f64; UNKNOWNS]; UNKNOWNS];

/// The Fisher matrix and the gradient of a particle by the pixels of one camera.
type Pull = (Matrix, Vector);

/// For each particle its place, mm, and its pulls by camera.
pub(super) fn pulls(cloud: &Cloud, setting: &Setting) -> Vec<([f64; 3], Vec<Pull>)> {
    let plan = cloud.plan(setting);
    let members = cloud.members(setting, &plan.tiles);
    let tasks: Vec<_> = plan.windows.iter().zip(&members).collect();
    let found: Vec<Vec<([f64; 3], Vec<Pull>)>> = tasks
        .par_iter()
        .map_init(Buffers::default, |buffers, (rectangles, own)| {
            let window = cloud.window(rectangles);
            let one = |n: &usize| {
                let spot = &cloud.spots[*n];
                let mut pulls = vec![Pull::default(); 1 + setting.views.len()];
                setting.image(spot, &window, buffers).pixels(window.columns, |n, by| {
                    let (seen, light) = (window.seen[n], window.light[n]);
                    if !seen.is_nan() {
                        let weight = 1.0 / f64::from(setting.noise_at(&window, n).variance(light));
                        let off = f64::from(seen - light);
                        let by = by.map(f64::from);
                        let (fisher, gradient) = &mut pulls[window.camera_of(n)];
                        for a in 0..UNKNOWNS {
                            gradient[a] += weight * off * by[a];
                            (0..UNKNOWNS).for_each(|b| fisher[a][b] += weight * by[a] * by[b]);
                        }
                    }
                });
                (spot.place_mm, pulls)
            };
            own.iter().map(one).collect()
        })
        .collect();
    found.concat()
}

/// A step of a camera's light and pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step([f64; UNKNOWN]);

/// The step of further camera number `camera` (1 is the first of them) that its pulls ask for; None if too few
/// particles tell it.
pub(super) fn step(
    pulls: &[([f64; 3], Vec<Pull>)],
    (camera, view): (usize, &View),
    pixel_mm: f64,
    prior: Prior,
    moves: bool,
) -> Option<Step> {
    let mut matrix = [[0f64; UNKNOWN]; UNKNOWN];
    let mut right = [0f64; UNKNOWN];
    let mut count = 0;
    for (place, pulls) in pulls {
        let (own, gradient) = &pulls[camera];
        if own[3][3] <= 0.0 || (gradient[3] / own[3][3]).abs() > MOST_OFF {
            continue;
        }
        count += 1;
        let (asked, pulled) = beyond(pulls, camera, prior);
        let by = effect(view, *place, pixel_mm);
        for a in 0..UNKNOWN {
            let along = |k: usize| (0..UNKNOWNS).map(|n| asked[k][n] * by[n][a]).sum::<f64>();
            let turned: Vector = std::array::from_fn(along);
            right[a] += (0..UNKNOWNS).map(|k| by[k][a] * pulled[k]).sum::<f64>();
            for b in 0..UNKNOWN {
                matrix[b][a] += (0..UNKNOWNS).map(|k| by[k][b] * turned[k]).sum::<f64>();
            }
        }
    }
    if count < LEAST {
        return None;
    }
    let size = if moves { UNKNOWN } else { 1 };
    let mut system: Vec<f64> = (0..size * size).map(|n| matrix[n / size][n % size]).collect();
    cholesky(&mut system, size);
    let mut solved = right[..size].to_vec();
    solve(&system, size, &mut solved);
    let mut step = [0.0; UNKNOWN];
    step[..size].copy_from_slice(&solved);
    step[0] = step[0].clamp(-LIGHT_STEP, LIGHT_STEP);
    step.iter().all(|value| value.is_finite()).then_some(Step(step))
}

/// A camera's Fisher matrix and gradient when the particle follows: `F - F T^-1 F` and `g - F T^-1 t`, T and t those of
/// all cameras.
fn beyond(pulls: &[Pull], camera: usize, prior: Prior) -> (Matrix, Vector) {
    let (own, gradient) = &pulls[camera];
    let mut total = [0f64; UNKNOWNS * UNKNOWNS];
    let mut pull = [0f64; UNKNOWNS];
    for (fisher, gradient) in pulls {
        (0..UNKNOWNS * UNKNOWNS).for_each(|n| total[n] += fisher[n / UNKNOWNS][n % UNKNOWNS]);
        (0..UNKNOWNS).for_each(|n| pull[n] += gradient[n]);
    }
    (0..UNKNOWNS).for_each(|n| total[n * UNKNOWNS + n] += prior.0[n].powi(-2));
    cholesky(&mut total, UNKNOWNS);
    solve(&total, UNKNOWNS, &mut pull);
    let mut asked = *own;
    for column in 0..UNKNOWNS {
        let mut solved: Vector = std::array::from_fn(|row| own[row][column]);
        solve(&total, UNKNOWNS, &mut solved);
        (0..UNKNOWNS).for_each(|row| {
            asked[row][column] -= (0..UNKNOWNS).map(|k| own[row][k] * solved[k]).sum::<f64>();
        });
    }
    let pulled = |row: usize| gradient[row] - (0..UNKNOWNS).map(|k| own[row][k] * pull[k]).sum::<f64>();
    (asked, std::array::from_fn(pulled))
}

/// How the unknowns of the camera move a particle for it: by x, y, z, pixels, and by the logarithm of the light.
fn effect(view: &View, place: [f64; 3], pixel_mm: f64) -> [[f64; UNKNOWN]; UNKNOWNS] {
    let back = view.pose.matrix().transpose();
    let there = DVec3::from(view.pose.to_camera(place));
    let mut by = [[0.0; UNKNOWN]; UNKNOWNS];
    by[3][0] = 1.0;
    for (n, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        let (turned, shifted) = (back * axis.cross(there) / pixel_mm, back * axis);
        for k in 0..3 {
            (by[k][1 + n], by[k][4 + n]) = (turned[k], shifted[k]);
        }
    }
    by
}

impl Step {
    /// Takes the step.
    pub(super) fn take(&self, view: &mut View, pixel_mm: f64) {
        let [light, a, b, c, x, y, z] = self.0;
        view.light *= light.exp();
        if self.0[1..] == [0.0; UNKNOWN - 1] {
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
    use crate::spot::Spot;
    use crate::view::tests::{ASIDE, DEPTH_MM, NOISE, PIXEL_MM, model, view};
    use crate::{further::Exposure, view::View};
    use ndarray::Array2;

    /// Forty particles at their true places. The pose of the second camera is off by 0.3 mrad and some tenths of a
    /// pixel, its light by a tenth: both come back.
    #[test]
    fn light_and_pose_of_a_camera_come_back() {
        let first = model(30);
        let mut truth = view(&first, ASIDE, 0.8);
        Step([0.0, 2e-4, -3e-4, 1e-4, 0.2, -0.3, 0.4]).take(&mut truth, PIXEL_MM);
        let place = |n: usize| {
            let part = |by: f64| (n as f64 * by).fract() - 0.5;
            [0.9 * part(0.618_034), 0.9 * part(0.754_878), 1.6 * part(0.569_840)]
        };
        let spots: Vec<Spot> = (0..40).map(|n| Spot { place_mm: place(n), light: 1e5 }).collect();
        let dark = Array2::<f32>::zeros((420, 420));
        let cloud = |views: &[View], images: [&Array2<f32>; 2]| {
            let setting = Setting { model: &first, views, noise: NOISE, pixel_mm: PIXEL_MM, depth_mm: DEPTH_MM };
            let mut cloud = Cloud::new(images[0].view(), spots.clone(), 120, 28.0);
            cloud.further = vec![Exposure { image: images[1].view(), light: vec![0.0; images[1].len()] }];
            cloud.render(&setting);
            let light = [cloud.light.clone(), cloud.further[0].light.clone()];
            (light.map(|light| Array2::from_shape_vec((420, 420), light).unwrap()), pulls(&cloud, &setting))
        };
        let (images, _) = cloud(std::slice::from_ref(&truth), [&dark, &dark]);
        let mut found = view(&first, ASIDE, 0.72);
        for _ in 0..5 {
            let (_, pulls) = cloud(std::slice::from_ref(&found), [&images[0], &images[1]]);
            let prior = Prior([14.0, 14.0, 1000.0, 1.0]);
            step(&pulls, (1, &found), PIXEL_MM, prior, true).unwrap().take(&mut found, PIXEL_MM);
        }
        assert!((found.light / 0.8 - 1.0).abs() < 1e-3, "{}", found.light);
        for spot in &spots {
            let off = |k: usize| (found.seen(spot).place_mm[k] - truth.seen(spot).place_mm[k]) / PIXEL_MM;
            assert!((0..2).all(|k| off(k).abs() < 0.02) && off(2).abs() < 0.1, "{:?}", [off(0), off(1), off(2)]);
        }
    }
}
