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
use super::recipe::{Fit, FitOptions, Progress, QUIET, SWEEP_GAIN, Work, depths_mm, fit, median, reach_of};
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

/// What was found of a camera.
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

/// Rounds of expectation maximisation on light.
const LIGHT_ROUNDS: usize = 15;
/// Faintest particle that is kept then, in medians.
const FAINTEST: f64 = 0.02;
/// Particles may leave the depths of those that the cameras found by this many pixels of the focal plane.
const BEYOND_PX: f64 = 40.0;

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
    let mut cloud = Cloud::new(sights[0].image, spots, reach_px);
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
    })
}

fn solve(mut work: Work, told: &mut impl FnMut(&Progress), cameras: &mut [CameraFit]) -> Fit {
    let moves = work.options.fits_pose;
    share(&mut work);
    align(&mut work, false);
    for what in ["first fit together", "fit together"] {
        work.sweeps(what, 1, 3, told);
        work.find_noise();
        align(&mut work, moves);
    }
    let mut stirred = vec![true; work.cloud.tiles().len()];
    for round in 0..work.options.rounds {
        let (changes, gain) = work.round(round, &mut stirred);
        work.find_noise();
        align(&mut work, moves);
        work.tell("round together", changes, gain, told);
        if (changes.iter().sum::<usize>() as f64) < QUIET * work.cloud.spots.len() as f64 {
            break;
        }
    }
    let judge: Judge = work.judge();
    let mut all = vec![true; work.cloud.tiles().len()];
    let (changes, gain) = work.change(&mut all, |local| {
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
