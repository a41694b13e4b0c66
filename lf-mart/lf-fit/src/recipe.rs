//! The whole fit: from a volume and an image to particles.

use super::buffers::Buffers;
use super::changes::Judge;
use super::cloud::{Cloud, Members, PAIRS, Plan, Tile};
use super::covariance::Prior;
use super::image::UNKNOWNS;
use super::joint::{Ends, Setting};
use super::local::{Changed, Local};
use super::noise::{Given, Noise};
use super::normal::Normal;
use super::shape::{Free, Sample, Shape};
use super::window::Window;
use super::{candidates, spot::Spot, view::View};
use lf_core::particle_image::ParticleModel;
use lf_core::{Camera, Grid, Refusal};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// The options of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitOptions {
    /// Where the fit of size and drift begins, or what is held.
    pub shape: Shape,
    /// Which parts of the shape are fitted.
    pub free: Free,
    /// Known parts of the noise.
    pub noise: Given,
    /// Most rounds of drop, split and add.
    pub rounds: usize,
    /// Whether the poses of further cameras are fitted.
    pub fits_pose: bool,
}

/// A particle that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Place and light.
    pub spot: Spot,
    /// Covariance of the place: xx, xy, xz, yy, yz, zz, mm^2.
    pub covariance_mm2: [f64; 6],
    /// Standard uncertainty of the light, counts.
    pub light_std: f64,
}

/// A step of the fit, for reports.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Its name.
    pub what: &'static str,
    /// Particles held.
    pub particles: usize,
    /// Particles dropped, split and added, or moved by the scan.
    pub changes: [usize; 3],
    /// Fall of -2 log L.
    pub gain: f64,
    /// Mean squared difference over variance where light is expected.
    pub misfit: f64,
    /// Size and drift.
    pub shape: Shape,
    /// The noise.
    pub noise: Noise,
}

/// The result of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The particles, by rising rows of their chief rays' tiles.
    pub particles: Vec<Found>,
    /// Size and drift.
    pub shape: Shape,
    /// Standard uncertainties of the size and of both drifts, pixels; 0 for what is held, infinite if none was found.
    pub shape_std_px: [f64; 3],
    /// The noise.
    pub noise: Noise,
    /// Mean squared difference over variance where light is expected.
    pub misfit: f64,
}

/// Sweeps of expectation maximisation on light, and the faintest candidate that is kept, in medians.
const LIGHT_SWEEPS: usize = 2;
pub(super) const LIGHT_ROUNDS: usize = 15;
pub(super) const FAINTEST: f64 = 0.02;
/// Fall of -2 log L that another particle must bring: five standard deviations.
const GAIN: f64 = 25.0;
/// Particles may leave the volume's depths by this many pixels of the focal plane.
pub(super) const BEYOND_PX: f64 = 40.0;
/// Particles that a part of the sensor sees from which size and drift are found, and its least side, pixels.
const SAMPLE: f64 = 200.0;
const SAMPLE_PX: f64 = 200.0;
/// Pixels do not tell the shape where the light of particles near focus passes this share of the noise, nor where the
/// image differs by more than these standard deviations: particles may be missing there.
const STRAY: f32 = 0.5;
const OUTLIER: f32 = 8.0;
/// Particles nearer to focus than this share of the scan's depths are left out of the shape's fit.
const TOO_NEAR: f64 = 0.6;
/// Most steps of a fit of size and drift.
const SHAPE_STEPS: usize = 10;
/// A change wakes particles within so many lenslets.
pub(super) const WAKES: f64 = 2.0;
/// Rounds in which candidates that were not kept are tried again.
const ADD_ROUNDS: usize = 2;
/// Rounds end when they change less than this share of the particles.
pub(super) const QUIET: f64 = 0.005;
/// A step of a tile that lowers -2 log L by less than this for each particle is the last of its sweep.
pub(super) const SWEEP_GAIN: f64 = 0.03;
/// Neighbours within these pixels of the focal plane are free when the covariance is found: 0.995 of the full.
const NEIGHBOURS_PX: f64 = 28.0;
/// Noise before any is found, as a share of the brightest pixels.
const FIRST_NOISE: f64 = 0.02;
/// Pixels are as bright as this quantile at least when they are called the brightest.
const BRIGHTEST: f64 = 0.999;
/// The scan reaches particles this many depths of focus from the focal plane; a depth of focus spreads a point by one
/// pixel on the array.
const SCAN_DEPTHS: f64 = 22.0;

/// Fits particles to an image.
///
/// `indices` and `intensity` are the voxels of a volume on `grid`, indices rising. Pixels that are NaN are blind.
/// `told` is called after each step. Refuses a volume without maxima, an image without light and what
/// [`ParticleModel::new`] refuses.
pub fn fit(
    camera: &Camera,
    image: ArrayView2<f32>,
    (grid, indices, intensity): (&Grid, &[u64], &[f32]),
    options: &FitOptions,
    mut told: impl FnMut(&Progress),
) -> Result<Fit, Refusal> {
    let spots = candidates::maxima(grid, indices, intensity);
    Refusal::unless(!spots.is_empty(), || "no voxel is brighter than its neighbours", "wanted a volume of particles")?;
    let image = image.as_standard_layout();
    let pixel_mm = camera.pixel_in_focus_mm();
    let depth_mm = depths_mm(camera, grid);
    let model = options.shape.model(camera, depth_mm)?;
    let noise = first_noise(image.view(), options.noise)?;
    let reach_px = reach_px(camera, grid, options)?;
    let prior = Prior([camera.pitch_px(), camera.pitch_px(), (depth_mm[1] - depth_mm[0]) / pixel_mm, 1.0]);
    let mut work = Work {
        camera,
        options,
        cloud: Cloud::new(image.view(), spots, reach_px, WAKES * camera.pitch_px()),
        model,
        views: Vec::new(),
        shape: options.shape,
        shape_std_px: [f64::INFINITY; 3],
        noise,
        pixel_mm,
        depth_mm,
        prior,
        candidates: Vec::new(),
        is_stale: false,
    };
    work.begin();
    for what in ["first fit", "fit", "fit"] {
        work.fit(what, 3, &mut told);
        work.find_noise();
        if work.shape(&mut told)? {
            break;
        }
    }
    work.cloud.wake_where(|_| true);
    for round in 0..options.rounds {
        let (changes, gain) = work.round(round);
        work.find_noise();
        work.tell("round", changes, gain, &mut told);
        if round > 0 && (changes.iter().sum::<usize>() as f64) < QUIET * work.cloud.spots.len() as f64 {
            break;
        }
    }
    work.finish(&mut told)
}

/// Depths between which particles are held, mm.
pub(super) fn depths_mm(camera: &Camera, grid: &Grid) -> [f64; 2] {
    let beyond = BEYOND_PX * camera.pixel_in_focus_mm();
    [grid.centre_mm(2, 0) - beyond, grid.centre_mm(2, grid.shape[2] - 1) + beyond]
}

/// Most pixels from a particle's chief ray to a pixel that it lights, for particles of up to twice the first size.
pub(super) fn reach_px(camera: &Camera, grid: &Grid, options: &FitOptions) -> Result<usize, Refusal> {
    reach_of(camera, depths_mm(camera, grid), options.shape.sigma_px)
}

/// The same for particles of this size within these depths.
pub(super) fn reach_of(camera: &Camera, depth_mm: [f64; 2], sigma_px: f64) -> Result<usize, Refusal> {
    let wide = ParticleModel::new(camera, 2.0 * sigma_px * camera.pixel_in_focus_mm(), depth_mm)?;
    Ok(depth_mm.into_iter().fold(0f64, |reach, z| reach.max(wide.reach_px(z))).ceil() as usize)
}

/// Side of the part of a sensor of this size that sees [`SAMPLE`] of so many particles.
pub(super) fn sample_side(size: [usize; 2], particles: usize, reach_px: usize) -> usize {
    let area = (size[0] * size[1]) as f64 / particles.max(1) as f64;
    ((SAMPLE * area).sqrt() - 2.0 * reach_px as f64).max(SAMPLE_PX) as usize
}

/// A fit at work.
pub(super) struct Work<'a> {
    pub(super) camera: &'a Camera,
    pub(super) options: &'a FitOptions,
    pub(super) cloud: Cloud<'a>,
    pub(super) model: ParticleModel,
    /// Further cameras.
    pub(super) views: Vec<View>,
    pub(super) shape: Shape,
    pub(super) shape_std_px: [f64; 3],
    pub(super) noise: Noise,
    pub(super) pixel_mm: f64,
    pub(super) depth_mm: [f64; 2],
    pub(super) prior: Prior,
    /// Candidates that were not kept.
    pub(super) candidates: Vec<Spot>,
    /// Whether the shape has moved since all particles were fitted.
    pub(super) is_stale: bool,
}

impl Work<'_> {
    pub(super) fn setting<'a>(
        model: &'a ParticleModel,
        views: &'a [View],
        noise: Noise,
        pixel_mm: f64,
        depth_mm: [f64; 2],
    ) -> Setting<'a> {
        Setting { model, views, noise, pixel_mm, depth_mm }
    }

    /// Shares the light out among the candidates and drops the faint ones.
    fn begin(&mut self) {
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        // The volume's light has no fixed scale: begin with the image's.
        let seen: f64 = self.cloud.image.iter().filter(|v| !v.is_nan()).map(|v| f64::from(v.max(0.0))).sum();
        let sum: f64 = self.cloud.spots.iter().map(|spot| spot.light).sum();
        self.cloud.spots.iter_mut().for_each(|spot| spot.light *= seen / sum);
        self.cloud.render(&setting);
        for _ in 0..LIGHT_SWEEPS {
            self.cloud.share_light(&setting, LIGHT_ROUNDS);
        }
        let least = FAINTEST * median(self.cloud.spots.iter().map(|spot| spot.light).collect());
        let (kept, faint) = self.cloud.spots.iter().partition(|spot| spot.light > least);
        (self.cloud.spots, self.candidates) = (kept, faint);
        self.cloud.render(&setting);
    }

    /// Fits size and drift in a part of the sensor, without the light near focus. Gives whether the fit came to its
    /// end.
    fn shape(&mut self, told: &mut impl FnMut(&Progress)) -> Result<bool, Refusal> {
        if !self.options.free.size && !self.options.free.drift {
            return Ok(true);
        }
        let Some(mut sample) = self.sample() else { return Ok(true) };
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        let found = sample.fit(&setting, self.shape, SHAPE_STEPS)?;
        self.shape_std_px = found.std_px;
        if found.shape.is_beyond(&self.shape, found.std_px) {
            self.cloud.is_whole.fill(false);
            self.is_stale = true;
        }
        self.take_shape(found.shape)?;
        self.tell("size and drift", [0; 3], 0.0, told);
        Ok(found.is_settled)
    }

    /// A part of the sensor that sees enough particles; None if no particle is there.
    fn sample(&self) -> Option<Sample<'_>> {
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        let size = [self.cloud.image.ncols(), self.cloud.image.nrows()];
        let margin = self.cloud.reach_px;
        let side = sample_side(size, self.cloud.spots.len(), margin);
        let part = size.map(|whole| [whole.saturating_sub(side) / 2, (whole + side.min(whole)).div_ceil(2)]);
        let low = part.map(|[low, _]| low.saturating_sub(margin));
        let high = [0, 1].map(|axis| (part[axis][1] + margin).min(size[axis]));
        let mut window = Window::cut(self.cloud.image, &self.cloud.light, low, high);
        let sees = |spot: &&Spot| {
            let place = self.model.chief_px(spot.place_mm);
            let reach = self.model.reach_px(spot.place_mm[2]);
            (0..2).all(|axis| place[axis] > part[axis][0] as f64 - reach && place[axis] < part[axis][1] as f64 + reach)
        };
        let too_near = TOO_NEAR * self.near_focus_mm();
        let seen: Vec<Spot> = self.cloud.spots.iter().filter(sees).copied().collect();
        let (near, far): (Vec<Spot>, Vec<Spot>) = seen.iter().partition(|spot| spot.place_mm[2].abs() < too_near);
        let (held, spots) = if far.len() > near.len() { (near, far) } else { (Vec::new(), seen) };
        let mut stray = vec![0f32; window.seen.len()];
        let mut buffers = Buffers::default();
        for spot in &held {
            setting.image(spot, &window, &mut buffers).add_to(&mut stray, window.columns, 1.0);
        }
        for (n, (light, stray)) in window.light.iter_mut().zip(&stray).enumerate() {
            let place = [low[0] + n % window.columns, low[1] + n / window.columns];
            let is_beyond = (0..2).any(|axis| !(part[axis][0]..part[axis][1]).contains(&place[axis]));
            let noise = self.noise.variance(*light).sqrt();
            let seen = &mut window.seen[n];
            if is_beyond || *stray > STRAY * noise || (*seen - *light).abs() > OUTLIER * noise {
                *seen = f32::NAN;
            }
            *light = *stray;
        }
        let free = self.options.free;
        (!spots.is_empty()).then_some(Sample { camera: self.camera, window, spots, free })
    }

    fn take_shape(&mut self, shape: Shape) -> Result<(), Refusal> {
        self.shape = shape;
        self.model = shape.model(self.camera, self.depth_mm)?;
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        self.cloud.render(&setting);
        Ok(())
    }

    /// Fits all particles once.
    fn sweep(&mut self, steps: usize) -> f64 {
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        self.cloud.sweep(&setting, Ends { steps, gain: SWEEP_GAIN })
    }

    /// Fits all particles.
    pub(super) fn fit(&mut self, what: &'static str, steps: usize, told: &mut impl FnMut(&Progress)) {
        let gain = self.sweep(steps);
        self.is_stale = false;
        self.tell(what, [0; 3], gain, told);
    }

    pub(super) fn find_noise(&mut self) {
        let noises = std::iter::once(&mut self.noise).chain(self.views.iter_mut().map(|view| &mut view.noise));
        for (camera, noise) in noises.enumerate() {
            if let Some(found) = Noise::found(&mut self.cloud.pairs(camera), self.options.noise) {
                *noise = found;
            }
        }
    }

    pub(super) fn judge(&self) -> Judge {
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        Judge {
            gain: GAIN * self.cloud.misfit(&setting).max(1.0),
            usual_light: median(self.cloud.spots.iter().map(|spot| spot.light).collect()),
            lenslet_px: self.camera.pitch_px(),
            near_mm: self.near_focus_mm(),
            prior: self.prior,
        }
    }

    /// Runs a change of the particles that are awake; those stay awake that it changes, and those near them. Gives the
    /// changes of each kind that were kept, and the fall of -2 log L that `work` tells.
    pub(super) fn change(&mut self, work: impl Fn(&mut Local) -> ([usize; 3], f64) + Sync) -> ([usize; 3], f64) {
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        let (mut sum, mut gain) = ([0; 3], 0.0);
        let task = |cloud: &Cloud, window: &mut Window, tile: &Tile, members: Members, buffers: &mut Buffers| {
            let mut local = Local::new(cloud, &setting, window, tile, members, buffers);
            let done = work(&mut local);
            (done, local.changed())
        };
        let is_awake = self.cloud.tiles_awake(&setting);
        let mut places = vec![Vec::new(); is_awake.len()];
        type Done = (([usize; 3], f64), Changed);
        self.cloud.each_tile(
            &setting,
            |n| is_awake[n],
            task,
            |cloud, n, ((counts, fall), mut changed): Done| {
                places[n] = std::mem::take(&mut changed.places);
                sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
                gain += fall;
                cloud.take(&changed);
            },
        );
        self.cloud.forget();
        self.cloud.wake_near(&setting, &places);
        if !self.views.is_empty() {
            // Further cameras see tiles behind each other, and their poses move between rounds.
            let has_changed = sum != [0; 3];
            self.cloud.wake_where(|_| has_changed);
        }
        (sum, gain)
    }

    /// Drop, split, add.
    pub(super) fn round(&mut self, round: usize) -> ([usize; 3], f64) {
        let judge = self.judge();
        let candidates = self.candidates_by_tile(round < ADD_ROUNDS);
        // A round fits the particles that are awake first.
        self.is_stale &= self.cloud.is_awake.contains(&false);
        self.change(|local| {
            let gain = local.fit(Ends { steps: 6, gain: SWEEP_GAIN });
            let dropped = local.drop_weak(&judge, false);
            let split = local.split(&judge);
            let added = local.add(&candidates[local.place], round == 0, &judge);
            ([dropped, split, added], gain)
        })
    }

    /// Candidates that were not kept, by tile; none unless they are `asked`.
    fn candidates_by_tile(&self, asked: bool) -> Vec<Vec<Spot>> {
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        let mut by_tile = vec![Vec::new(); self.cloud.tiles().len()];
        for spot in self.candidates.iter().filter(|_| asked) {
            by_tile[self.cloud.tile_of(&setting, spot)].push(*spot);
        }
        by_tile
    }

    pub(super) fn tell(&self, what: &'static str, changes: [usize; 3], gain: f64, told: &mut impl FnMut(&Progress)) {
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        let misfit = self.cloud.misfit(&setting);
        let Self { shape, noise, .. } = *self;
        told(&Progress { what, particles: self.cloud.spots.len(), changes, gain, misfit, shape, noise });
    }

    /// Scans near focus, drops once more, and ends.
    fn finish(mut self, told: &mut impl FnMut(&Progress)) -> Result<Fit, Refusal> {
        self.shape(told)?;
        if self.is_stale {
            self.fit("fit", 6, told);
        }
        let judge = self.judge();
        let rounds = self.options.rounds;
        self.cloud.wake_where(|_| true);
        let (changes, gain) = self.change(|local| {
            // A scan takes long: without rounds, drop noise first.
            let weak = if rounds == 0 { local.drop_weak(&judge, false) } else { 0 };
            let moved = local.scan(&judge);
            let dropped = weak + local.drop_weak(&judge, true);
            ([dropped, 0, moved], 0.0)
        });
        self.tell("scan", changes, gain, told);
        self.find_noise();
        Ok(self.end(told))
    }

    /// Fits all particles to the end, and finds all uncertainties.
    pub(super) fn end(mut self, told: &mut impl FnMut(&Progress)) -> Fit {
        let gain = self.sweep(8);
        self.cloud.wake_where(|_| true);
        self.tell("last fit", [0; 3], gain, told);
        let setting = Self::setting(&self.model, &self.views, self.noise, self.pixel_mm, self.depth_mm);
        let misfit = self.cloud.misfit(&setting);
        let particles = self.uncertainties(&setting);
        let Self { shape, shape_std_px, noise, .. } = self;
        Fit { particles, shape, shape_std_px, noise, misfit }
    }

    /// Depth from focus over which a scan is worth its time, mm.
    fn near_focus_mm(&self) -> f64 {
        let optics = lf_core::Optics::new(self.camera);
        let slope = (optics.alpha(0.05) - optics.alpha(-0.05)).abs() / 0.1;
        let depth_of_focus = self.camera.sensor.pixel_pitch_mm / (slope * 2.0 * optics.half_aperture_mm);
        SCAN_DEPTHS * depth_of_focus
    }

    fn uncertainties(&self, setting: &Setting) -> Vec<Found> {
        let Plan { tiles, windows, .. } = self.cloud.plan(setting);
        let members = self.cloud.members(setting, &tiles);
        let found: Vec<Vec<Found>> = (0..tiles.len())
            .into_par_iter()
            .map_init(Buffers::default, |buffers, tile| {
                let mut window = self.cloud.window(&windows[tile]);
                let members = Members { tiles: &tiles, lists: &members, own: tile };
                let mut local = Local::new(&self.cloud, setting, &mut window, &tiles[tile], members, buffers);
                let all: Vec<usize> = (0..local.members.len()).collect();
                let normal = local.normal(&all);
                let own = all.iter().filter(|n| local.members[**n].is_own);
                own.map(|n| self.uncertain(&local, (&normal, &all), *n)).collect()
            })
            .collect();
        found.concat()
    }

    fn uncertain(&self, local: &Local, normal: (&Normal, &[usize]), n: usize) -> Found {
        let covariance: [[f64; UNKNOWNS]; UNKNOWNS] = local.covariance(normal, n, NEIGHBOURS_PX, self.prior);
        let spot = local.members[n].spot;
        let square = self.pixel_mm * self.pixel_mm;
        let at = |a: usize, b: usize| square * 0.5 * (covariance[a][b] + covariance[b][a]);
        Found {
            spot,
            covariance_mm2: [at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2)],
            light_std: spot.light * covariance[3][3].sqrt(),
        }
    }
}

/// Noise for the first fits, of the size of the model's errors then.
fn first_noise(image: ArrayView2<f32>, given: Given) -> Result<Noise, Refusal> {
    let rows = image.rows().into_iter().step_by(image.len().div_ceil(PAIRS));
    let mut bright: Vec<f32> = rows.flatten().copied().filter(|value| *value > 0.0).collect();
    Refusal::unless(!bright.is_empty(), || "no pixel has light", "wanted an image of particles")?;
    let at = ((bright.len() as f64 * BRIGHTEST) as usize).min(bright.len() - 1);
    let peak = f64::from(*bright.select_nth_unstable_by(at, f32::total_cmp).1);
    let read = lf_core::image::noise(image).max(FIRST_NOISE * 0.1 * peak);
    Ok(Noise {
        gain: given.gain.unwrap_or(FIRST_NOISE * peak * 0.1),
        read_variance: given.read_variance.unwrap_or(read * read),
    })
}

pub(super) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
