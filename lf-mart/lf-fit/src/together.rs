//! Several cameras that see the same particles: each is fitted alone, then all together.
//!
//! Alone, a camera finds its size, its drift, its noise, and particles whose depth is their weak side. Where two cameras
//! look along different axes, the depth of one is sideways for the other: matched particles begin where both agree. The
//! fit of all pixels has one place and one light for each particle, and for each further camera its light over the
//! first's, and its pose.

use super::align;
use super::changes::Judge;
use super::cloud::Cloud;
use super::covariance::Prior;
use super::further::Exposure;
use super::joint::Ends;
use super::merge;
use super::noise::Noise;
use super::recipe::{BEYOND_PX, FAINTEST, Fit, FitOptions, LIGHT_ROUNDS, Progress, QUIET, SWEEP_GAIN, WAKES, Work};
use super::recipe::{depths_mm, fit, median, reach_of};
use super::shape::Shape;
use super::view::View;
use lf_core::camera::Pose;
use lf_core::{Camera, Grid, Refusal};
use ndarray::ArrayView2;

/// A camera with its image and the volume that was made of it, in the camera's own frame.
#[derive(Debug, Clone, Copy)]
pub struct Sight<'a> {
    /// The camera; its pose counts.
    pub camera: &'a Camera,
    /// Its image; NaN where a pixel is blind.
    pub image: ArrayView2<'a, f32>,
    /// Grid, rising indices and intensities.
    pub volume: (&'a Grid, &'a [u64], &'a [f32]),
}

/// A camera as the fit finds it.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraFit {
    /// Size and drift, by the camera alone.
    pub shape: Shape,
    /// Their standard uncertainties, pixels.
    pub shape_std_px: [f64; 3],
    /// The noise.
    pub noise: Noise,
    /// Its light of a particle over that of the first camera.
    pub light: f64,
    /// From the frame of the first camera to its own.
    pub pose: Pose,
    /// Particles that it found alone, and those of them that it shares with the cameras before it.
    pub particles: usize,
    /// Pairs with the particles of the cameras before it.
    pub shared: usize,
}

/// The particles in the frame of the first camera, and the cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct Together {
    /// The fit of all pixels; size, drift and noise are those of the first camera.
    pub fit: Fit,
    /// The cameras, the first one first.
    pub cameras: Vec<CameraFit>,
}

/// Fits particles to the images of several cameras. `told` is called after each step, with the camera's number from 0 on
/// if one is fitted alone. A refusal comes with the number of its camera.
pub fn fit_together<'a>(
    sights: &[Sight<'a>],
    options: &'a FitOptions,
    mut told: impl FnMut(Option<usize>, &Progress),
) -> Result<Together, (usize, Refusal)> {
    let mut alone = Vec::new();
    for (n, sight) in sights.iter().enumerate() {
        let fitted = fit(sight.camera, sight.image, sight.volume, options, |step| told(Some(n), step));
        alone.push(fitted.map_err(|refusal| (n, refusal))?);
    }
    let first = sights[0].camera;
    let pixel_mm = first.pixel_in_focus_mm();
    let poses: Vec<Pose> =
        sights.iter().map(|sight| Pose::between(first.pose.as_ref(), sight.camera.pose.as_ref())).collect();
    let mut list = merge::placed(&alone[0].particles, &Pose::default());
    let mut cameras = vec![camera_fit(&alone[0], Pose::default(), 1.0, 0)];
    for (n, (found, pose)) in alone.iter().zip(&poses).enumerate().skip(1) {
        let other = merge::placed(&found.particles, pose);
        let lost =
            || (n, Refusal::new("shares no particle with the cameras before it", "wanted the pose of the camera"));
        let (light, shared) = merge::merge(&mut list, &other, pixel_mm).ok_or_else(lost)?;
        cameras.push(camera_fit(found, *pose, light, shared));
    }
    let work = begin(sights, options, &cameras, merge::spots(&list))?;
    let fit = solve(work, &mut |step| told(None, step), &mut cameras);
    Ok(Together { fit, cameras })
}

fn camera_fit(found: &Fit, pose: Pose, light: f64, shared: usize) -> CameraFit {
    let Fit { shape, shape_std_px, noise, ref particles, .. } = *found;
    CameraFit { shape, shape_std_px, noise, light, pose, particles: particles.len(), shared }
}

/// The fit of all before its first step.
pub(super) fn begin<'a>(
    sights: &[Sight<'a>],
    options: &'a FitOptions,
    cameras: &[CameraFit],
    spots: Vec<super::Spot>,
) -> Result<Work<'a>, (usize, Refusal)> {
    let (first, pixel_mm) = (sights[0].camera, sights[0].camera.pixel_in_focus_mm());
    let beyond = BEYOND_PX * pixel_mm;
    // The depths of a camera's volume and of all particles.
    let depths = |sight: &Sight, pose: &Pose| {
        spots.iter().fold(depths_mm(sight.camera, sight.volume.0), |[low, high], spot| {
            let z = pose.to_camera(spot.place_mm)[2];
            [low.min(z - beyond), high.max(z + beyond)]
        })
    };
    let mut views = Vec::new();
    for (n, (sight, found)) in sights.iter().zip(cameras).enumerate().skip(1) {
        let CameraFit { shape, noise, light, pose, .. } = *found;
        let model = shape.model(sight.camera, depths(sight, &pose)).map_err(|refusal| (n, refusal))?;
        views.push(View { model, pose, light, noise, pixel_mm: sight.camera.pixel_in_focus_mm() });
    }
    let depth_mm = depths(&sights[0], &Pose::default());
    let CameraFit { shape, shape_std_px, noise, .. } = cameras[0];
    let model = shape.model(first, depth_mm).map_err(|refusal| (0, refusal))?;
    let reach_px = reach_of(first, depth_mm, shape.sigma_px).map_err(|refusal| (0, refusal))?;
    let prior = Prior([first.pitch_px(), first.pitch_px(), (depth_mm[1] - depth_mm[0]) / pixel_mm, 1.0]);
    let mut cloud = Cloud::new(sights[0].image, spots, reach_px, WAKES * first.pitch_px());
    let dark = |sight: &Sight<'a>| Exposure { image: sight.image, light: vec![0.0; sight.image.len()] };
    cloud.further = sights[1..].iter().map(dark).collect();
    let candidates = Vec::new();
    Ok(Work {
        camera: first,
        options,
        cloud,
        model,
        views,
        shape,
        shape_std_px,
        noise,
        pixel_mm,
        depth_mm,
        prior,
        candidates,
        is_stale: false,
    })
}

fn solve(mut work: Work, told: &mut impl FnMut(&Progress), cameras: &mut [CameraFit]) -> Fit {
    let moves = work.options.fits_pose;
    share(&mut work);
    align(&mut work, false);
    for what in ["first fit together", "fit together"] {
        work.fit(what, 3, told);
        work.find_noise();
        align(&mut work, moves);
    }
    work.cloud.wake_where(|_| true);
    for round in 0..work.options.rounds {
        let (changes, gain) = work.round(round);
        work.find_noise();
        align(&mut work, moves);
        work.tell("round together", changes, gain, told);
        if (changes.iter().sum::<usize>() as f64) < QUIET * work.cloud.spots.len() as f64 {
            break;
        }
    }
    let judge: Judge = work.judge();
    work.cloud.wake_where(|_| true);
    let (changes, gain) = work.change(|local| {
        let dropped = local.drop_weak(&judge, true);
        ([dropped, 0, 0], local.fit(Ends { steps: 8, gain: SWEEP_GAIN }))
    });
    work.tell("pairs together", changes, gain, told);
    work.find_noise();
    align(&mut work, moves);
    for (view, camera) in work.views.iter().zip(&mut cameras[1..]) {
        (camera.light, camera.pose, camera.noise) = (view.light, view.pose, view.noise);
    }
    let fit = work.end(told);
    cameras[0].noise = fit.noise;
    fit
}

/// Shares the light of all images out among the particles and drops the faint ones.
fn share(work: &mut Work) {
    let Work { model, views, noise, pixel_mm, depth_mm, cloud, candidates, .. } = work;
    let setting = Work::setting(model, views, *noise, *pixel_mm, *depth_mm);
    cloud.render(&setting);
    cloud.share_light(&setting, LIGHT_ROUNDS);
    let least = FAINTEST * median(cloud.spots.iter().map(|spot| spot.light).collect());
    (cloud.spots, *candidates) = cloud.spots.iter().partition(|spot| spot.light > least);
    cloud.is_whole = vec![false; cloud.spots.len()];
    cloud.wake_where(|_| true);
    cloud.render(&setting);
}

/// Fits light and, if it `moves`, the pose of each further camera, the particles following.
fn align(work: &mut Work, moves: bool) {
    let Work { model, views, noise, pixel_mm, depth_mm, cloud, prior, .. } = work;
    for n in 0..views.len() {
        let setting = Work::setting(model, views, *noise, *pixel_mm, *depth_mm);
        let pulls = align::pulls(cloud, &setting);
        if let Some(step) = align::step(&pulls, (n + 1, &views[n]), *pixel_mm, *prior, moves) {
            step.take(&mut views[n], *pixel_mm);
        }
        let setting = Work::setting(model, views, *noise, *pixel_mm, *depth_mm);
        cloud.render(&setting);
    }
}

#[cfg(test)]
mod tests {
    use crate::buffers::Buffers;
    use crate::covariance::{Prior, covariance};
    use crate::image::{SpotImage, UNKNOWNS};
    use crate::joint::{Ends, Setting};
    use crate::normal::{Normal, cholesky, solve};
    use crate::spot::Spot;
    use crate::view::tests::{ASIDE, DEPTH_MM, NOISE, PIXEL_MM, model, numbers, view, whole};
    use crate::window::Window;

    const SIZE: usize = 3 * UNKNOWNS;

    fn light(setting: &Setting, spots: &[Spot], window: &Window) -> Vec<f64> {
        let mut sum = vec![0.0; window.seen.len()];
        for spot in spots {
            numbers(setting, spot, window).iter().zip(&mut sum).for_each(|(pixel, sum)| *sum += pixel[3]);
        }
        sum
    }

    fn moved(spots: &[Spot], n: usize, by: f64) -> Vec<Spot> {
        let mut spots = spots.to_vec();
        match n % UNKNOWNS {
            3 => spots[n / UNKNOWNS].light *= by.exp(),
            axis => spots[n / UNKNOWNS].place_mm[axis] += by * PIXEL_MM,
        }
        spots
    }

    /// Derivatives by differences, and the dense normal equations: matrix and right side.
    fn dense(setting: &Setting, spots: &[Spot], window: &Window) -> (Vec<f64>, Vec<f64>) {
        let now = light(setting, spots, window);
        let slopes: Vec<Vec<f64>> = (0..SIZE)
            .map(|n| {
                let step = if n % UNKNOWNS == 3 { 1e-3 } else { 0.02 };
                let (before, after) =
                    (light(setting, &moved(spots, n, -step), window), light(setting, &moved(spots, n, step), window));
                after.iter().zip(&before).map(|(after, before)| (after - before) / (2.0 * step)).collect()
            })
            .collect();
        let seen: Vec<usize> = (0..now.len()).filter(|n| !window.seen[*n].is_nan()).collect();
        let weight = |n: usize| 1.0 / (NOISE.gain * now[n] + NOISE.read_variance);
        let sum = |a: usize, with: &dyn Fn(usize) -> f64| -> f64 {
            seen.iter().map(|n| weight(*n) * slopes[a][*n] * with(*n)).sum()
        };
        let matrix = (0..SIZE * SIZE).map(|n| sum(n / SIZE, &|pixel| slopes[n % SIZE][pixel])).collect();
        let right = (0..SIZE).map(|a| sum(a, &|pixel| f64::from(window.seen[pixel]) - now[pixel])).collect();
        (matrix, right)
    }

    /// Three particles that share pixels, before two cameras at 90 degrees: the fit and its covariances are those of
    /// slow dense least squares.
    #[test]
    fn two_cameras_fit_as_dense_least_squares_do() {
        let first = model(20);
        let views = [view(&first, ASIDE, 0.8)];
        let setting = Setting { model: &first, views: &views, noise: NOISE, pixel_mm: PIXEL_MM, depth_mm: DEPTH_MM };
        let mut window = whole(&first, &first);
        let truth = [[0.0, 0.0, 0.5], [0.05, 0.04, 0.45], [-0.06, 0.1, -0.4]];
        let truth = truth.map(|place_mm| Spot { place_mm, light: 1e5 });
        let clean = light(&setting, &truth, &window);
        // Numbers of no pattern, about as large as the noise.
        for (n, seen) in window.seen.iter_mut().enumerate() {
            let even: f64 = (0..4).map(|k| ((n * 4 + k) as f64 * 0.618_033_988_75).fract() - 0.5).sum();
            *seen += (clean[n] + even * 1.7 * (NOISE.gain * clean[n] + NOISE.read_variance).sqrt()) as f32;
        }
        let start: Vec<Spot> = (0..SIZE).fold(truth.to_vec(), |spots, n| {
            moved(&spots, n, [0.3, -0.2, 0.9, 0.1][n % UNKNOWNS] * [1.0, -1.0, 0.7][n / UNKNOWNS])
        });
        let mut slow = start.clone();
        for _ in 0..8 {
            let (mut matrix, mut right) = dense(&setting, &slow, &window);
            cholesky(&mut matrix, SIZE);
            solve(&matrix, SIZE, &mut right);
            slow = (0..SIZE).fold(slow, |spots, n| moved(&spots, n, right[n]));
        }
        let mut buffers = Buffers::default();
        let images: Vec<SpotImage> = start.iter().map(|spot| setting.image(spot, &window, &mut buffers)).collect();
        let ends = Ends { steps: 40, gain: 1e-9 };
        let fitted = setting.joint(&mut window, &start, images, ends, &mut buffers);
        for (fast, slow) in fitted.spots.iter().zip(&slow) {
            for k in 0..3 {
                let off = (fast.place_mm[k] - slow.place_mm[k]) / PIXEL_MM;
                assert!(off.abs() < 4e-3, "axis {k}: {off:.1e} px");
            }
            assert!((fast.light / slow.light - 1.0).abs() < 1e-4);
        }
        // Covariances, without a prior worth the name.
        fitted.images.iter().for_each(|image| image.add_to(&mut window.light, window.columns, 1.0));
        buffers.paint(fitted.images.iter(), window.columns);
        setting.weigh_whole(&window, &mut buffers);
        let normal = Normal::new(fitted.images.iter(), window.columns, &mut buffers);
        let found = covariance(&normal, &[1, 0, 2], Prior([1e3; UNKNOWNS]));
        let (mut matrix, _) = dense(&setting, &slow, &window);
        cholesky(&mut matrix, SIZE);
        for k in 0..UNKNOWNS {
            let mut column = vec![0.0; SIZE];
            column[UNKNOWNS + k] = 1.0;
            solve(&matrix, SIZE, &mut column);
            let wanted = column[UNKNOWNS + k];
            assert!((found[k][k] / wanted - 1.0).abs() < 0.02, "unknown {k}: {} for {wanted}", found[k][k]);
        }
    }
}
