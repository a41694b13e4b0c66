//! The recipe of the fit: from images and volumes to particles, over a list of cameras.
//!
//! Each camera is fitted alone first. Where there are several, a second fit of the same stages begins at the particles
//! that they found, with all cameras in its list. Where two cameras look along different axes, the depth of one is
//! sideways for the other: matched particles begin where both agree.

use crate::cameras::input::CameraInput;
use crate::cameras::lens::correctable;
use crate::cameras::matching;
use crate::cameras::noise::{KnownNoise, Noise};
use crate::cameras::residual::Residual;
use crate::cameras::shape::{Free, Shape};
use crate::cameras::view::{BEYOND_PX, CameraView, Cameras, depths_mm};
use crate::model::buffers::FitBuffers;
use crate::model::window::Window;
use crate::particle::{FoundParticle, Particle};
use crate::search::changes::{Criteria, Faint};
use crate::search::particles::{Members, Particles};
use crate::search::tile_fit::{Changed, TileFit};
use crate::search::tiles::Tile;
use crate::shared::align::align;
use crate::shared::sample::Sample;
use crate::solve::covariance::Prior;
use crate::solve::joint::StopRule;
use crate::solve::{parts, untold};
use glam::DVec2;
use lf_core::Refusal;
use lf_core::camera::{EXPLAINED, Evidence, LensletPattern, Pose};

/// The options of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitOptions {
    /// The first shape.
    pub shape: Shape,
    /// The shared unknowns that are fitted.
    pub free: Free,
    /// Known parts of the noise.
    pub noise: KnownNoise,
    /// Largest number of rounds of drop and split.
    pub rounds: usize,
    /// Whether evidence of the frame on its camera is asked for.
    pub evidence: bool,
}

/// Changes that were kept.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Changes {
    /// Particles that were dropped.
    pub dropped: usize,
    /// Particles that were split.
    pub split: usize,
    /// Particles that were added, or moved by a scan.
    pub added: usize,
    /// Fall of -2 log L.
    pub gain: f64,
}

/// A step of the fit, for reports.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// The number of the camera that is fitted alone. None if all are fitted.
    pub camera: Option<usize>,
    /// Name of the step.
    pub what: &'static str,
    /// Number of particles.
    pub particles: usize,
    /// The changes by the step.
    pub changes: Changes,
    /// Mean squared difference over variance where light is expected.
    pub misfit: f64,
    /// Size and drift of the first camera.
    pub shape: Shape,
    /// Noise of the first camera.
    pub noise: Noise,
}

/// The result of a fit.
#[derive(Debug, Clone)]
pub struct Fit<'a> {
    /// The particles in the frame of the first camera, by rising rows of their chief rays' tiles.
    pub particles: Vec<FoundParticle>,
    /// The cameras, the first one first.
    pub cameras: Vec<CameraView<'a>>,
    /// Mean squared difference over variance where light is expected.
    pub misfit: f64,
    /// Whether the differences that are left are noise.
    pub residual: Residual,
    /// The stated variances are this much larger than those of noise alone.
    pub excess: f64,
    /// The stated uncertainties along x, y and z are usually this much larger, because parts of an image disagree.
    pub widened: [f64; 3],
    /// Standard deviation of the logarithm of the particles' sizes; 0 if all may be of one size.
    pub size_spread: f64,
    /// Number of particles near focus whose uncertainty sideways is that of a lenslet.
    pub untold: usize,
    /// Doubts that arose while each camera was fitted alone.
    pub doubts: Vec<Doubts>,
    /// Whether particles were no longer added because the misfit did not fall.
    pub is_stopped: bool,
    /// Evidence of the frame on its only camera, if it was asked for.
    pub evidence: Option<Evidence>,
}

/// Doubts of the model of a camera.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Doubts {
    /// The misfit without a blur, where the camera names none and the image asked for one.
    pub misfit_sharp: Option<f64>,
    /// The misfit with the far field, where the camera names no pattern and Fresnel's explains the image better.
    pub misfit_far: Option<f64>,
    /// The number of particles that the given ones lacked, if the fit began anew without the given ones.
    pub missing: Option<usize>,
}

/// Differences between the stages of one camera and those of several.
#[derive(Debug)]
struct Schedule {
    /// Number of passes over the tiles that share the light out among the first particles.
    light_passes: usize,
    /// Names of the first fits of all particles.
    first_fits: &'static [&'static str],
    /// Name of a round, and the smallest number of rounds.
    round: &'static str,
    least_rounds: usize,
    /// Name of the last change.
    last_change: &'static str,
    /// Whether the last change scans. It takes long, and several cameras have no blind depths.
    scans: bool,
}

const ALONE: Schedule = Schedule {
    light_passes: 2,
    first_fits: &["first fit"],
    round: "round",
    least_rounds: 2,
    last_change: "scan",
    scans: true,
};
const TOGETHER: Schedule = Schedule {
    light_passes: 1,
    first_fits: &["first fit together", "fit together"],
    round: "round together",
    least_rounds: 1,
    last_change: "pairs together",
    scans: false,
};

/// Fresnel's pattern is tried if differences of neighbouring pixels correlate by more than this. After the first fits
/// the right pattern left 0.012 to 0.7, more where particles were still missing, and the wrong one 0.148 and more.
const SUSPECT: f64 = 0.1;
/// Name of the step that fits the shape, and of one that corrects the camera too.
const SHAPE_STEP: &str = "size and drift";
const CAMERA_STEP: &str = "camera";
/// Rounds of expectation maximisation in a pass, and the light of the faintest maximum and of the faintest particle
/// that is kept, as shares of the light above which half of all light is. Among 1795 found particles none began at a
/// maximum below a tenth, and none of them had less than a fifth after the first fit; a third of the maxima are
/// below a twentieth.
const LIGHT_ROUNDS: usize = 15;
pub(crate) const FAINTEST_MAXIMUM: f64 = 0.05;
const FAINTEST: f64 = 0.1;
/// The first fit of the shape ends with a step below this, px. Spare particles move the shape by more.
const FIRST_SHAPE_PX: f64 = 0.002;
/// A drift below this is taken as zero, px. Fits of lattices that were still found up to 0.004 px, another one in each
/// frame of a pair: x of a particle 3 mm from focus errs by nine times as much.
const STILL_PX: f64 = 0.005;
/// Steps of a fit of all particles: of the first ones, of one in a round, and of the last one.
const FIRST_STEPS: usize = 3;
const ROUND_STEPS: usize = 6;
const LAST_STEPS: usize = 8;
/// A step of a tile that lowers -2 log L by less than this for each particle is the last.
const SWEEP_GAIN: f64 = 0.03;
/// Smallest fall of -2 log L for another particle: five standard deviations.
const GAIN: f64 = 25.0;
/// A correction of the camera moves rays by more than this share of their bend, because images of bent rays err too.
/// Behind 180 mm of water the errors look like an aberration of 0.7 px, in one frame and not in the next.
const OF_BEND: f64 = 0.2;
/// With a blur that the camera does not name, at most this share of the particles is left: less than half in all frames
/// tried. A lattice that is off makes a blur look good too, but leaves as many.
const FEWER: f64 = 0.8;
/// Rounds of a fit that noise does not explain end when the misfit falls by less than from 1 to this.
const LEAST_FALL: f64 = 0.99;
/// The fit begins anew without the given particles if they lack this share of their number. Particles of the frame
/// before lack a tenth if a field has moved them, and 0.75 to 1.2 of their number if they are 11 px off.
const MOST_MISSING: f64 = 0.5;
/// Particles whose light is uncertain by more than this share of it are left out of the result. One beyond the frame's
/// rim, of which 0.02 % was seen, had 250 times the usual light.
const UNSURE: f64 = 0.5;
/// Rounds end when they change less than this share of the particles.
const QUIET: f64 = 0.005;

/// Fits particles to the images of one or several cameras. Calls `on_step` after each step. A refusal comes with the
/// number of its camera.
///
/// Refuses a volume without maxima, an image without light, and what [`lf_core::particle_image::ParticleModel::new`]
/// refuses.
pub fn fit<'a>(
    inputs: &'a [CameraInput],
    options: &FitOptions,
    mut on_step: impl FnMut(&Progress),
) -> Result<Fit<'a>, (usize, Refusal)> {
    let mut alone = Vec::new();
    for (n, input) in inputs.iter().enumerate() {
        let camera = (inputs.len() > 1).then_some(n);
        alone.push(fit_alone(input, camera, options, &mut on_step).map_err(|refusal| (n, refusal))?);
    }
    if alone.len() == 1 {
        return Ok(alone.remove(0));
    }
    let doubts = alone.iter().flat_map(|fit| fit.doubts.clone()).collect();
    let particles = start_together(alone)?;
    let held = FitOptions {
        free: Free { size: false, sizes: false, drift: false, blur: false, camera: false, ..options.free },
        ..*options
    };
    let together =
        Stages::new(particles, None, &held, &TOGETHER, &mut on_step).run().map_err(|refusal| (0, refusal))?;
    Ok(Fit { doubts, ..together })
}

/// Fits a camera alone. Particles beyond the sides of its volume are fitted too, and left out of the result.
fn fit_alone<'a>(
    input: &'a CameraInput,
    camera: Option<usize>,
    options: &FitOptions,
    on_step: &mut dyn FnMut(&Progress),
) -> Result<Fit<'a>, Refusal> {
    let mut fit = fit_all(input, camera, options, on_step)?;
    fit.particles.retain(|found| input.holds(&found.particle));
    Ok(fit)
}

/// Begins anew where the first particles were given and are not those of the image.
fn fit_all<'a>(
    input: &'a CameraInput,
    camera: Option<usize>,
    options: &FitOptions,
    on_step: &mut dyn FnMut(&Progress),
) -> Result<Fit<'a>, Refusal> {
    let mut stages = Stages::new(start_alone(input, &input.first, options)?, camera, options, &ALONE, on_step);
    if !input.is_given {
        stages.input = Some(input);
        return stages.run();
    }
    stages.begin()?;
    stages.fit("fit", FIRST_STEPS);
    // This comes before any particle is split, because the light of a missing one spoils the fits beside it.
    let missing = stages.add_what_is_left(input)?;
    if (missing as f64) < MOST_MISSING * input.first.len() as f64 {
        return stages.finish();
    }
    let first = input.particles_in(input.image.pixels.view())?;
    let mut stages = Stages::new(start_alone(input, &first, options)?, camera, options, &ALONE, on_step);
    stages.input = Some(input);
    let mut fit = stages.run()?;
    fit.doubts[0].missing = Some(missing);
    Ok(fit)
}

/// One camera and its first particles.
pub(crate) fn start_alone<'a>(
    input: &'a CameraInput,
    first: &[Particle],
    options: &FitOptions,
) -> Result<Particles<'a>, Refusal> {
    let (camera, image, flat) = (&input.camera, &input.image.pixels, input.image.flat.as_ref());
    let mut list = first.to_vec();
    let found =
        || if input.is_given { "no first particle lies in it" } else { "no voxel is brighter than its neighbours" };
    Refusal::unless(!list.is_empty(), found, "wanted a volume of particles")?;

    // Scale their light to the image. That of the volume has no fixed scale.
    let seen: f64 = image.iter().filter(|v| !v.is_nan()).map(|v| f64::from(v.max(0.0))).sum();
    let sum: f64 = list.iter().map(|particle| particle.light).sum();
    list.iter_mut().for_each(|particle| particle.light *= seen / sum);
    let noise = Noise::first(image.view(), options.noise.of(camera))?;
    let view = CameraView::new(
        camera,
        (image, flat),
        options.shape.first(camera),
        depths_mm(camera, input.volume.grid()),
        noise,
    )?;
    Particles::new(Cameras { views: vec![view] }, list)
}

/// All cameras, and the particles that each found alone, merged.
fn start_together(alone: Vec<Fit>) -> Result<Particles, (usize, Refusal)> {
    // Merge the particles in the frame of the first camera.
    let (first, pixel_mm) = (alone[0].cameras[0].camera, alone[0].cameras[0].pixel_mm);
    let mut list = matching::placed(&alone[0].particles, &Pose::default());
    let mut views = Vec::new();
    for (n, Fit { particles, cameras, .. }) in alone.into_iter().enumerate() {
        let mut view = cameras.into_iter().next().expect("a fit has a camera");
        view.particles_alone = particles.len();
        if n > 0 {
            view.pose = Pose::between(first.pose.as_ref(), view.camera.pose.as_ref());
            let other = matching::placed(&particles, &view.pose);
            let lost =
                || Refusal::new("shares no particle with the cameras before it", "wanted the pose of the camera");
            let shared = matching::merge(&mut list, &other, pixel_mm).ok_or_else(|| (n, lost()))?;
            (view.light, view.shared) = (shared.light, shared.pairs);
        }
        views.push(view);
    }

    // Widen the depths of each camera to those of all particles.
    let list = matching::particles(&list);
    join(views, list)
}

/// Cameras that see particles together. Each sees the depths of its own volume and those of the particles.
pub(crate) fn join<'a>(mut views: Vec<CameraView<'a>>, list: Vec<Particle>) -> Result<Particles<'a>, (usize, Refusal)> {
    let beyond = BEYOND_PX * views[0].pixel_mm;
    for (n, view) in views.iter_mut().enumerate() {
        let depth_mm = list.iter().fold(view.depth_mm, |[low, high], particle| {
            let z = view.pose.to_camera(particle.place_mm)[2];
            [low.min(z - beyond), high.max(z + beyond)]
        });
        let (expected, far, waves) = (std::mem::take(&mut view.expected), view.far.take(), view.waves.take());
        *view = view.reshaped(view.shape, depth_mm).map_err(|refusal| (n, refusal))?;
        view.model.set_exact(false);
        (view.expected, view.far, view.waves) = (expected, far, waves);
    }
    Particles::new(Cameras { views }, list).map_err(|refusal| (0, refusal))
}

/// A fit at work.
struct Stages<'a, 'o> {
    particles: Particles<'a>,
    /// The number of the camera that is fitted alone.
    camera: Option<usize>,
    options: &'o FitOptions,
    free: Free,
    schedule: &'static Schedule,
    on_step: &'o mut dyn FnMut(&Progress),
    prior: Prior,
    /// The input, until the rounds have looked for missing particles in its image.
    input: Option<&'a CameraInput>,
    /// Whether the shape has moved since all particles were fitted.
    is_stale: bool,
    /// Whether the last fit of the shape came to its end.
    is_settled: bool,
    /// The standard uncertainties of the drift, once the lattice is known to be still.
    still: Option<[f64; 2]>,
    doubts: Doubts,
    is_stopped: bool,
}

impl<'a, 'o> Stages<'a, 'o> {
    fn new(
        particles: Particles<'a>,
        camera: Option<usize>,
        options: &'o FitOptions,
        schedule: &'static Schedule,
        on_step: &'o mut dyn FnMut(&Progress),
    ) -> Self {
        let first = particles.cameras.first();
        let (pitch_px, [low, high]) = (first.camera.pitch_px(), first.depth_mm);
        let prior = Prior([pitch_px, pitch_px, (high - low) / first.pixel_mm, 1.0]);
        // Blades hide the rim that shows where the lattice is. Without it x was .1 to .3 px off, and .02 with the drift
        // held.
        let drift_is_free = options.free.drift && first.camera.blades.is_none();
        Self {
            particles,
            camera,
            options,
            free: Free { drift: drift_is_free, ..options.free },
            schedule,
            on_step,
            prior,
            input: None,
            is_stale: false,
            is_settled: true,
            still: None,
            doubts: Doubts::default(),
            is_stopped: false,
        }
    }

    /// The stages in their order.
    fn run(mut self) -> Result<Fit<'a>, Refusal> {
        self.begin()?;
        self.finish()
    }

    /// Fits the first particles, and corrects a camera that does not explain its image.
    fn begin(&mut self) -> Result<(), Refusal> {
        let maxima = self.particles.list.clone();
        self.first_fits(&maxima)?;
        if self.correct_camera()? {
            // Particles found with the wrong camera may be wrong.
            let Shape { lens_px, drift_px, pattern, .. } = self.particles.cameras.first().shape;
            let first = self.options.shape.first(self.particles.cameras.first().camera);
            self.particles = self.anew(Shape { lens_px, drift_px, pattern, ..first }, &maxima)?;
            self.doubts = Doubts::default();
            self.first_fits(&maxima)?;
            self.correct_camera()?;
        }
        Ok(())
    }

    /// Changes particles until no change is worth it, and ends with exact images.
    fn finish(mut self) -> Result<Fit<'a>, Refusal> {
        self.particles.wake_where(|_| true);
        self.rounds(0)?;
        self.particles.cameras.views.iter_mut().for_each(|view| view.model.set_exact(true));
        self.particles.summed.forget();
        self.particles.render();
        self.own_sizes()?;
        if self.is_stale {
            self.fit("fit", ROUND_STEPS);
        }
        self.last_change();
        self.find_noise();
        self.align();
        self.end()
    }

    /// Adds the particles that sweeps find in what the others leave of the image, and returns their number.
    fn add_what_is_left(&mut self, input: &CameraInput) -> Result<usize, Refusal> {
        let view = self.particles.cameras.first();
        let tiling = self.particles.tiling();
        let mut candidates = vec![Vec::new(); tiling.tiles().len()];
        for particle in input.particles_in((&view.image - &view.expected()).view())? {
            candidates[tiling.tile_of(&self.particles.cameras, &particle)].push(particle);
        }
        let criteria = self.criteria();
        let changes = self.change(|tile| {
            let added = tile.add_candidates(&candidates[tile.place], &criteria);
            Changes { added, ..Changes::default() }
        });
        self.report("what is left", changes);
        Ok(changes.added)
    }

    /// Rounds until they change little, from the one with this number on.
    fn rounds(&mut self, first: usize) -> Result<(), Refusal> {
        let Schedule { round: name, least_rounds, .. } = *self.schedule;
        self.is_stopped = false;
        let (mut misfit, mut alike) = (f64::INFINITY, f64::INFINITY);
        let mut is_fruitful = false;
        for round in first..self.options.rounds {
            let changes = self.round();
            self.find_noise();
            if round == 0 && self.blind_defects() {
                self.particles.wake_where(|_| true);
            }
            self.align();
            self.report(name, changes);
            if self.particles.size_spread.is_some() {
                self.fit_sizes()?;
            }
            // Particles that were missing may have kept the first fit of the shape from its end, or misled it.
            if is_fruitful || round == 0 && !self.is_settled {
                self.fit_shape()?;
            }
            let residual = self.particles.cameras.residual();
            if round + 1 >= least_rounds {
                let is_done = self.is_few(changes.dropped + changes.split);
                match self.input.filter(|_| is_fruitful || self.particles.cameras.has_light_left()) {
                    // Beside bright particles, faint ones were no maxima. The next round fits them.
                    Some(input) => {
                        let added = self.add_what_is_left(input)?;
                        is_fruitful = !self.is_few(added);
                        self.input = Some(input).filter(|_| is_fruitful);
                        continue;
                    }
                    None if is_done => break,
                    None => {}
                }
            }
            // More particles do not mend a wrong model.
            let before = std::mem::replace(&mut misfit, self.particles.cameras.misfit());
            let alike_before = std::mem::replace(&mut alike, residual.beside);
            let is_stuck = misfit > EXPLAINED && misfit > LEAST_FALL * before;
            if is_stuck || residual.is_model_error() && alike > LEAST_FALL * alike_before {
                self.is_stopped = true;
                break;
            }
        }
        Ok(())
    }

    /// Shares the light out, and fits all particles, the noise and the shape.
    fn first_fits(&mut self, maxima: &[Particle]) -> Result<(), Refusal> {
        self.share_light();
        align(&mut self.particles, self.prior, false);
        let mut is_open = false;
        for (n, what) in self.schedule.first_fits.iter().enumerate() {
            self.fit(what, FIRST_STEPS);
            self.find_noise();
            self.blind_defects();
            if n == 0 {
                is_open = self.try_blur(maxima, FEWER)?;
                self.drop_faint(FAINTEST);
            }
            self.fit_shape_to(FIRST_SHAPE_PX)?;
            self.align();
            if n == 0 {
                self.try_fresnel(maxima)?;
            }
        }
        if is_open {
            self.fit("fit", FIRST_STEPS);
            self.try_blur(maxima, f64::INFINITY)?;
            self.fit_shape()?;
            self.try_fresnel(maxima)?;
            self.fit("fit", FIRST_STEPS);
            self.find_noise();
            self.fit_shape()?;
        }
        Ok(())
    }

    /// Begins anew with a blur if the camera names none and a blur does better with its own particles, of which there
    /// may be `most` times as many. The misfit does not show it, because the noise is found too. Returns whether a blur
    /// does better, but not with so few particles.
    fn try_blur(&mut self, maxima: &[Particle], most: f64) -> Result<bool, Refusal> {
        let shape = self.particles.cameras.first().shape;
        if !self.is_alone() || !self.options.free.blur || shape.blur_px.is_some() {
            return Ok(false);
        }
        let misfit = self.particles.cameras.misfit();
        // A size that was found without a blur is too large.
        let shape = Shape { sigma_px: self.options.shape.sigma_px, ..shape.blurred() };
        let count = |particles: &Particles| particles.list.len() as f64;
        let cost = |particles: &Particles| particles.cameras.first().deviance() + GAIN * count(particles);
        let blurred = self.anew(shape, maxima)?;
        let sharp = std::mem::replace(&mut self.particles, blurred);
        self.share_light();
        let gain = self.sweep(FIRST_STEPS);
        let is_better = cost(&self.particles) < cost(&sharp);
        let is_taken = is_better && count(&self.particles) <= most * count(&sharp);
        let what = if is_taken { "fit with a blur" } else { "fit with a blur, given up" };
        self.report(what, Changes { gain, ..Changes::default() });
        if is_taken {
            self.find_noise();
            self.doubts.misfit_sharp = Some(misfit);
        } else {
            self.particles = sharp;
        }
        Ok(is_better && !is_taken)
    }

    /// Begins anew with Fresnel's pattern in lenslets if the far field does not explain the image, Fresnel's explains
    /// a sample of it better, and the camera names neither.
    fn try_fresnel(&mut self, maxima: &[Particle]) -> Result<(), Refusal> {
        let view = self.particles.cameras.first();
        let blur = view.shape.camera(view.camera).blur;
        let is_open = blur.is_some_and(|blur| blur.wavelength_nm.is_some() && blur.pattern.is_none());
        // Given particles may lack some, which no pattern explains.
        let is_complete = self.is_alone() && self.input.is_some();
        if !is_complete || !is_open || self.particles.cameras.residual().beside < SUSPECT {
            return Ok(());
        }
        let (far, misfit) = (view.shape, self.particles.cameras.misfit());
        let fresnel = Shape { pattern: Some(LensletPattern::Fresnel), ..far };
        // The noise is that of the far field for both. After one step frames in Fresnel's pattern had 0.13 to 0.75 of
        // the misfit, frames in the far field twice and more.
        let misfit_after_step = |shape: Shape| -> Result<Option<f64>, Refusal> {
            self.sample(shape, self.free)?.map(Sample::misfit_after_step).transpose()
        };
        let (Some(by_far), Some(by_fresnel)) = (misfit_after_step(far)?, misfit_after_step(fresnel)?) else {
            return Ok(());
        };
        if by_fresnel > by_far {
            return Ok(());
        }
        self.particles = self.anew(Shape { sigma_px: self.options.shape.sigma_px, ..fresnel }, maxima)?;
        self.share_light();
        self.fit("fit with Fresnel's pattern", FIRST_STEPS);
        self.find_noise();
        self.drop_faint(FAINTEST);
        self.fit_shape_to(FIRST_SHAPE_PX)?;
        self.doubts.misfit_far = Some(misfit);
        Ok(())
    }

    /// Whether a round that changes this number of particles changes little.
    fn is_few(&self, count: usize) -> bool {
        (count as f64) < QUIET * self.particles.list.len() as f64
    }

    /// Whether the list has one camera.
    fn is_alone(&self) -> bool {
        self.particles.cameras.views.len() == 1
    }

    /// Shares the light of the images out among the maxima, and drops the faint ones.
    fn share_light(&mut self) {
        self.drop_faint(FAINTEST_MAXIMUM);
        for _ in 0..self.schedule.light_passes {
            self.particles.share_light(LIGHT_ROUNDS, FAINTEST * self.particles.weighty_light());
        }
        self.drop_faint(FAINTEST);
    }

    fn drop_faint(&mut self, share: f64) {
        self.particles.drop_faint(share);
        self.particles.render();
    }

    /// Fits all particles.
    fn fit(&mut self, what: &'static str, steps: usize) {
        let gain = self.sweep(steps);
        self.report(what, Changes { gain, ..Changes::default() });
    }

    fn sweep(&mut self, steps: usize) -> f64 {
        self.is_stale = false;
        self.particles.sweep(StopRule { steps, gain: SWEEP_GAIN })
    }

    /// Fits the shape, and sizes of the particles' own if they differ. Before the rounds, particles that overlap look
    /// like large ones. Before the shape, a blur that is 0.006 px too wide looks like sizes that fall with depth.
    fn own_sizes(&mut self) -> Result<(), Refusal> {
        self.fit_shape()?;
        let CameraView { shape, shape_std_px, .. } = *self.particles.cameras.first();
        let (list, is_stopped) = (self.particles.list.clone(), self.is_stopped);
        if !self.fit_sizes()? {
            return Ok(());
        }
        self.rounds(1)?;
        self.fit_shape()?;
        self.fit_sizes()?;
        if self.particles.size_spread.is_some() {
            return Ok(());
        }
        // Sizes that turn out to be one have moved particles near focus.
        self.particles.cameras.views[0].set_shape(shape, shape_std_px)?;
        self.particles.set(list);
        self.particles.render();
        self.is_stopped = is_stopped;
        self.is_stale = true;
        Ok(())
    }

    /// Fits sizes of the particles' own, where they differ. Returns whether a size has changed.
    fn fit_sizes(&mut self) -> Result<bool, Refusal> {
        if !self.free.sizes || !self.is_alone() || !self.particles.fit_sizes(self.prior, self.free.size)? {
            return Ok(false);
        }
        self.particles.render();
        self.is_stale = true;
        self.report("sizes", Changes::default());
        Ok(true)
    }

    /// The parts of the first sensor from which a shape is found, by a camera of this shape.
    fn sample(&self, shape: Shape, free: Free) -> Result<Option<Sample<'a>>, Refusal> {
        let Particles { cameras, list, reach_px, .. } = &self.particles;
        Sample::new(cameras, shape, (list, *reach_px), free)
    }

    /// All that is free, with every parameter of the first camera that may be corrected.
    fn all_free(&self) -> Free {
        let lens = correctable(self.particles.cameras.first().camera).map(|may_move| may_move && self.free.camera);
        Free { lens, ..self.free }
    }

    /// The shared unknowns that a fit of the shape moves.
    fn moving(&self) -> Free {
        let may_drift = self.still.is_none() || self.free.lens.contains(&true);
        Free { drift: self.free.drift && may_drift, ..self.free }
    }

    /// Fits the shape of the first camera.
    fn fit_shape(&mut self) -> Result<(), Refusal> {
        self.fit_shape_to(0.0)
    }

    /// Like [`Self::fit_shape`]; a step below `enough_px` pixels is the last.
    fn fit_shape_to(&mut self, enough_px: f64) -> Result<(), Refusal> {
        let (shape, free) = (self.particles.cameras.first().shape, self.moving());
        if !free.shapes(&shape).contains(&true) {
            return Ok(());
        }
        let Some(sample) = self.sample(shape, free)? else { return Ok(()) };
        let mut found = sample.fit(enough_px)?;
        let is_camera = free.lens.contains(&true);
        if free.drift && !is_camera && DVec2::from(found.shape.drift_px).length() < STILL_PX {
            // Fit the others without it.
            self.still = Some([found.std_px[1], found.std_px[2]]);
            found.shape.drift_px = [0.0; 2];
            let free = self.moving();
            if free.shapes(&shape).contains(&true) {
                let Some(sample) = self.sample(found.shape, free)? else { return Ok(()) };
                found = sample.fit(enough_px)?;
            }
        }
        if let (Some(std), false) = (self.still, is_camera) {
            found.std_px[1..3].copy_from_slice(&std);
        }
        if found.shape.is_beyond(&shape, found.std_px) {
            self.particles.is_whole.fill(false);
            self.is_stale = true;
        }
        self.particles.cameras.views[0].set_shape(found.shape, found.std_px)?;
        if is_camera {
            // A spherical aberration moves all depths.
            let mut list = std::mem::take(&mut self.particles.list);
            found.particles.into_iter().for_each(|(place, moved)| list[place] = moved);
            self.particles.set(list);
        }
        self.particles.render();
        self.report(if is_camera { CAMERA_STEP } else { SHAPE_STEP }, Changes::default());
        self.is_settled = found.is_settled;
        Ok(())
    }

    /// Fits parameters of a camera that does not explain its image, one after another, the likeliest first. Returns
    /// whether any was fitted.
    fn correct_camera(&mut self) -> Result<bool, Refusal> {
        let given = self.free.lens;
        while self.free.camera && self.is_alone() {
            let Some(sample) = self.sample(self.particles.cameras.first().shape, self.all_free())? else { break };
            let Some(likely) = sample.cause()?.filter(|k| !self.free.lens[*k]) else { break };
            let (before, free) = (self.particles.clone(), self.free);
            self.free.lens[likely] = true;
            self.fit_shape()?;
            self.fit("fit", FIRST_STEPS);
            let first = self.particles.cameras.first();
            let is_sure = first.shape.is_corrected(likely, first.shape_std_px)
                && first.shape.lens_px[likely].abs() > OF_BEND * first.model.bend_px();
            if !is_sure || first.deviance() + GAIN > before.cameras.first().deviance() {
                (self.particles, self.free) = (before, free);
                break;
            }
            self.find_noise();
        }
        Ok(self.free.lens != given)
    }

    /// The maxima, before any of them is fitted, for the first camera with another shape.
    fn anew(&self, shape: Shape, maxima: &[Particle]) -> Result<Particles<'a>, Refusal> {
        let CameraView { camera, ref image, flat, depth_mm, noise, ref defects, .. } = *self.particles.cameras.first();
        let view = CameraView::new(camera, (image, flat), shape, depth_mm, noise)?;
        let view = CameraView { defects: defects.clone(), ..view };
        Particles::new(Cameras { views: vec![view] }, maxima.to_vec())
    }

    /// Fits light and pose of further cameras.
    fn align(&mut self) {
        align(&mut self.particles, self.prior, self.options.free.pose);
    }

    fn find_noise(&mut self) {
        for view in &mut self.particles.cameras.views {
            view.noise =
                Noise::found(&mut view.noise_pairs(), self.options.noise.of(view.camera)).unwrap_or(view.noise);
        }
    }

    /// Makes defects of the sensors blind. Returns whether there are new ones.
    fn blind_defects(&mut self) -> bool {
        self.particles.cameras.views.iter_mut().fold(false, |is_new, view| view.blind_defects() | is_new)
    }

    fn criteria(&self) -> Criteria {
        let first = self.particles.cameras.first();
        Criteria {
            gain: GAIN * self.particles.cameras.misfit().max(1.0),
            usual_light: self.particles.usual_light(),
            lenslet_px: first.camera.pitch_px(),
            faint: Faint::of(&self.particles.cameras, &self.particles.cameras.residual()),
            near_mm: first.near_focus_mm(),
            prior: self.prior,
        }
    }

    /// Runs `work` on the tiles with particles that are awake. Afterwards, those that it changed and those near them
    /// are awake. Returns the sum of the changes.
    fn change(&mut self, work: impl Fn(&mut TileFit) -> Changes + Sync) -> Changes {
        let mut sum = Changes::default();
        let task = |all: &Particles, window: &mut Window, tile: &Tile, members: Members, buffers: &mut FitBuffers| {
            let mut tile_fit = TileFit::new(all, window, tile, members, buffers);
            let done = work(&mut tile_fit);
            (done, tile_fit.changed())
        };
        let is_awake = self.particles.tiles_awake();
        let mut places = vec![Vec::new(); is_awake.len()];
        self.particles.each_tile(
            |n| is_awake[n],
            task,
            |all, n, (done, mut changed): (Changes, Changed)| {
                places[n] = std::mem::take(&mut changed.places);
                sum.dropped += done.dropped;
                sum.split += done.split;
                sum.added += done.added;
                sum.gain += done.gain;
                all.take(&changed);
            },
        );
        self.particles.forget();
        self.particles.wake_near(&places);
        if !self.is_alone() {
            // Further cameras see tiles behind each other, and their poses move between rounds.
            let has_changed = sum.dropped + sum.split + sum.added > 0;
            self.particles.wake_where(|_| has_changed);
        }
        sum
    }

    /// Drop and split.
    fn round(&mut self) -> Changes {
        let criteria = self.criteria();
        // A round fits the particles that are awake first.
        self.is_stale &= self.particles.is_awake.contains(&false);
        self.change(|tile| {
            let gain = tile.fit(StopRule { steps: ROUND_STEPS, gain: SWEEP_GAIN });
            let dropped = tile.drop_weak(&criteria, false);
            let split = tile.split(&criteria);
            Changes { dropped, split, added: 0, gain }
        })
    }

    /// One camera: scans near focus and drops what that makes spare. Several: drops pairs, and fits all again.
    fn last_change(&mut self) {
        let mut criteria = self.criteria();
        criteria.gain *= self.particles.cameras.residual().excess();
        let (rounds, scans) = (self.options.rounds, self.schedule.scans);
        self.particles.wake_where(|_| true);
        let changes = self.change(|tile| {
            // A scan takes long: without rounds, drop noise first.
            let weak = if scans && rounds == 0 { tile.drop_weak(&criteria, false) } else { 0 };
            let added = if scans { tile.scan(&criteria) } else { 0 };
            let dropped = weak + tile.drop_weak(&criteria, true);
            let rule = StopRule { steps: LAST_STEPS, gain: SWEEP_GAIN };
            let gain = if scans { 0.0 } else { tile.fit(rule) };
            Changes { dropped, split: 0, added, gain }
        });
        self.report(self.schedule.last_change, changes);
    }

    fn report(&mut self, what: &'static str, changes: Changes) {
        let Particles { cameras, list, .. } = &self.particles;
        let CameraView { shape, noise, .. } = *cameras.first();
        let (camera, misfit) = (self.camera, cameras.misfit());
        (self.on_step)(&Progress { camera, what, particles: list.len(), changes, misfit, shape, noise });
    }

    /// Fits all particles to the end, and finds all uncertainties.
    fn end(mut self) -> Result<Fit<'a>, Refusal> {
        self.fit("last fit", LAST_STEPS);
        self.particles.wake_where(|_| true);
        let (misfit, residual) = (self.particles.cameras.misfit(), self.particles.cameras.residual());
        let excess = residual.excess() * if misfit > EXPLAINED { misfit } else { 1.0 };
        let evidence = self.evidence(excess)?;
        let (particles, pulls) = self.particles.uncertainties(self.prior);
        let least_light = Faint::of(&self.particles.cameras, &residual).least_light * self.particles.usual_light();
        let is_sure = |FoundParticle { particle, light_std, .. }: &FoundParticle| {
            *light_std < UNSURE * particle.light && particle.light > least_light
        };
        let seen = particles.into_iter().zip(pulls).filter(|(found, _)| is_sure(found));
        let (mut particles, pulls): (Vec<_>, Vec<_>) = seen.unzip();
        let widened = parts::widen(&mut particles, &pulls, excess);
        let untold = if self.is_alone() { untold::widen(&mut particles, self.particles.cameras.first()) } else { 0 };
        Ok(Fit {
            particles,
            cameras: self.particles.cameras.views,
            misfit,
            residual,
            excess,
            widened,
            size_spread: self.particles.size_spread.map_or(0.0, |spread| spread.std()),
            untold,
            doubts: vec![self.doubts],
            is_stopped: self.is_stopped,
            evidence,
        })
    }

    /// Evidence of the frame on its only camera. All parameters are free that were not to be held.
    fn evidence(&self, excess: f64) -> Result<Option<Evidence>, Refusal> {
        if !self.options.evidence || !self.is_alone() {
            return Ok(None);
        }
        let Some(sample) = self.sample(self.particles.cameras.first().shape, self.all_free())? else { return Ok(None) };
        Ok(Some(Evidence { chi2: self.particles.cameras.misfit(), ..sample.evidence(excess)? }))
    }
}
