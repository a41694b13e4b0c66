//! Changes of the number of particles, and of places in another minimum: drop, split, add, scan. Each is judged by a
//! fit of the particles within a lenslet, and kept if -2 log L falls by enough.

use super::tile_fit::{Equations, Member, TileFit};
use crate::cameras::residual::Residual;
use crate::cameras::view::Cameras;
use crate::model::particle_image::{COUNTS, ParticleImage};
use crate::model::window::Window;
use crate::particle::Particle;
use crate::solve::covariance::Prior;
use crate::solve::joint::{Fitted, StopRule};

/// Criteria by which changes are judged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Criteria {
    /// Smallest fall of -2 log L for another particle.
    pub(crate) gain: f64,
    /// Light of a usual particle.
    pub(crate) usual_light: f64,
    /// Pixels of the focal plane in a lenslet.
    pub(crate) lenslet_px: f64,
    pub(crate) faint: Faint,
    /// Depth from focus within which places have several minima, mm.
    pub(crate) near_mm: f64,
    pub(crate) prior: Prior,
}

/// Trials: of a split or an addition, of the ways to split, of a drop, and from the best places of a scan.
const TRIAL: StopRule = StopRule { steps: 10, gain: 0.5 };
const BRIEF: StopRule = StopRule { steps: 2, gain: 0.5 };
const DROP_TRIAL: StopRule = StopRule { steps: 8, gain: 0.5 };
const SCAN_TRIAL: StopRule = StopRule { steps: 15, gain: 0.5 };
/// Misfit, in standard deviations, and light over the usual, beyond which a particle may be two.
const MISFIT: f64 = 4.0;
const BRIGHT: f64 = 1.5;
/// Bright particles are split first, as if their misfit were larger by this.
const BRIGHT_FIRST: f64 = 20.0;
/// Places of a half of a split, measured from the middle, pixels of the focal plane.
const HALVES: [[f64; 3]; 7] = [
    [3.0, 0.0, 0.0],
    [0.0, 3.0, 0.0],
    [0.0, 0.0, 15.0],
    [3.0, 3.0, 20.0],
    [3.0, -3.0, 20.0],
    [-3.0, 3.0, 20.0],
    [-3.0, -3.0, 20.0],
];
/// Largest number of passes of drops in a round.
const DROPS: usize = 6;
/// Largest distance in depth of a neighbour that takes a dropped particle's light, pixels of the focal plane.
const HEIR: f64 = 150.0;
/// A pixel of distance in depth counts like this many sideways when the nearest neighbour takes the light.
const DEPTH_WEIGHT: f64 = 0.1;
/// Two particles within these pixels, sideways and in depth, are usually one that the model draws badly: with one
/// particle a lenslet, two in a thousand lie so near to each other. The fainter one is dropped if the image of one
/// particle differs from theirs by less than the share ALIKE.
const TWIN: [f64; 2] = [1.5, 60.0];
const ALIKE: f64 = 0.3;
/// Light of a faint particle over the usual, and the largest light at which a new one begins.
const FAINT: f64 = 0.2;
const BRIGHTEST_NEW: f64 = 3.0;
/// Smallest distance sideways between candidates that are tried, pixels of the focal plane.
const APART: f64 = 6.0;
/// Steps of a scan near focus, sideways and in depth, pixels of the focal plane.
const SCAN_ASIDE: [f64; 7] = [-9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0];
const SCAN_DEPTH: [f64; 9] = [-84.0, -63.0, -42.0, -21.0, 0.0, 21.0, 42.0, 63.0, 84.0];
/// Number of places from which fits start after a scan. They differ by at least these pixels along an axis.
const SCAN_BEST: usize = 3;
const SCAN_APART: [f64; 3] = [4.0, 4.0, 25.0];
/// Smallest fall of -2 log L for a particle to move.
const SCAN_GAIN: f64 = 1.0;
/// Misfit, in standard deviations, from which a particle near focus is scanned.
const SCAN_MISFIT: f64 = 0.5;
/// A scan frees the neighbours within a lenslet and this number of pixels.
const SCAN_MARGIN_PX: f64 = 2.0;

/// The matched filter of the residual: fall of -2 log L by a particle alone, and its light over that of the image.
fn filter(cameras: &Cameras, window: &Window, image: &ParticleImage) -> (f64, f64) {
    let [along, square] = along_residual(cameras, window, image);
    if along > 0.0 && square > 0.0 { (along * along / square, along / square) } else { (0.0, 0.0) }
}

/// Products of an image with the residual and with itself, over the variance of the pixels.
fn along_residual(cameras: &Cameras, window: &Window, image: &ParticleImage) -> [f64; 2] {
    let (mut along, mut square) = (0.0, 0.0);
    image.pixels(window.columns, |n, pixel| {
        let (seen, light) = (window.seen[n], window.light[n]);
        if !seen.is_nan() {
            let weight = f64::from(pixel[COUNTS] / window.noise(cameras, n).variance(light));
            along += weight * f64::from(seen - light);
            square += weight * f64::from(pixel[COUNTS]);
        }
    });
    [along, square]
}

/// Limits of faint particles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Faint {
    /// The light below which none is taken, over the usual.
    pub(crate) least_light: f64,
    /// Their gain over that of others.
    spare: f64,
}

impl Faint {
    /// The errors of bright particles look like faint ones where the model does not explain the images, and beside
    /// Fresnel's patterns: the model errs where the stop cuts them.
    pub(crate) fn of(cameras: &Cameras, residual: &Residual) -> Self {
        if residual.is_model_error() || cameras.first().model.follows_waves() {
            Self { least_light: 0.05, spare: 10.0 }
        } else {
            Self { least_light: 0.01, spare: 2.0 }
        }
    }
}

impl Criteria {
    /// Smallest fall of -2 log L for a particle with this light over the usual.
    fn gain_of(&self, light: f64) -> f64 {
        match light {
            light if light < self.faint.least_light => f64::INFINITY,
            ..FAINT => self.faint.spare * self.gain,
            _ => self.gain,
        }
    }
}

impl TileFit<'_, '_> {
    /// Drops own particles whose light the image does not support, until it supports all. Returns their number. With
    /// `pairs`, one of two within a lenslet near focus is tried too, even if both are strong.
    pub(crate) fn drop_weak(&mut self, criteria: &Criteria, pairs: bool) -> usize {
        let own = |tile: &Self, n: usize| tile.members[n].is_own;
        let mut asked: Vec<usize> = (0..self.members.len()).filter(|n| own(self, *n)).collect();
        let mut dropped = 0;
        for round in 0..DROPS {
            let hit = self.drop_apart(&asked, criteria, pairs && round == 0);
            dropped += hit.len();
            // Ask the neighbours of dropped particles: only they may have become weak.
            asked = hit.iter().flat_map(|place| self.near(*place, 2.0 * criteria.lenslet_px)).collect();
            asked.sort_unstable();
            asked.dedup();
            asked.retain(|n| own(self, *n));
            if asked.is_empty() {
                break;
            }
        }
        dropped
    }

    /// Drops weak ones among the members `asked`, each more than a lenslet from the others. Returns their places.
    fn drop_apart(&mut self, asked: &[usize], criteria: &Criteria, pairs: bool) -> Vec<[f64; 3]> {
        // List the weak ones, the weakest first.
        let about = |n: &usize| self.near(self.members[*n].particle.place_mm, criteria.lenslet_px);
        let mut listed: Vec<usize> = asked.iter().flat_map(about).collect();
        listed.sort_unstable();
        listed.dedup();
        let equations = self.equations(listed);
        let strength = |n: &usize| self.strength(*n, &equations, criteria, pairs);
        let mut weak: Vec<(f64, Particle)> = asked.iter().filter_map(strength).collect();
        weak.sort_by(|a, b| a.0.total_cmp(&b.0));

        // Try each without neighbours that were dropped just now.
        let mut hit: Vec<[f64; 3]> = Vec::new();
        for (_, particle) in weak {
            let lenslet_mm = criteria.lenslet_px * self.cameras.pixel_mm();
            let is_hit = |place: &[f64; 3]| (0..2).all(|k| (place[k] - particle.place_mm[k]).abs() < lenslet_mm);
            let Some(n) = self.number(&particle) else { continue };
            if hit.iter().any(is_hit) {
                continue;
            }
            let near = self.near(particle.place_mm, criteria.lenslet_px);
            // The dropped one comes last, so that it is the one that goes.
            let mut order: Vec<usize> = near.iter().copied().filter(|other| *other != n).collect();
            let mut rest = self.particles(&order);
            self.inherit(&particle, &mut rest, criteria);
            order.push(n);
            let (fitted, gain) = self.attempt(&order, &rest, DROP_TRIAL);
            let least = criteria.gain_of(particle.light / criteria.usual_light);
            if -gain < least.max(ALIKE * ALIKE * self.strength_of_twins(n)) {
                self.keep(&order, fitted, particle.place_mm);
                hit.push(particle.place_mm);
            }
        }
        hit
    }

    /// A weak member, after the fall of -2 log L that it brings. None for a strong one.
    fn strength(&self, n: usize, equations: &Equations, criteria: &Criteria, pairs: bool) -> Option<(f64, Particle)> {
        let Member { particle, image, .. } = &self.members[n];
        if image.is_dark() {
            return Some((0.0, *particle));
        }
        let strength = 1.0 / self.covariance(equations, n, criteria.lenslet_px, criteria.prior)[COUNTS][COUNTS];
        let is_twin = self.twin(n).is_some_and(|twin| twin.light >= particle.light);
        let is_weak = strength < criteria.gain || is_twin || (pairs && self.is_paired(n, criteria));
        is_weak.then_some((strength, *particle))
    }

    /// The number of the member that is this particle; None if an earlier change moved it.
    fn number(&self, particle: &Particle) -> Option<usize> {
        self.members.iter().position(|member| member.particle == *particle)
    }

    /// The particles of some members.
    fn particles(&self, members: &[usize]) -> Vec<Particle> {
        members.iter().map(|n| self.members[*n].particle).collect()
    }

    /// Whether a particle near focus has another beside it with which it may be one.
    fn is_paired(&self, n: usize, criteria: &Criteria) -> bool {
        let z_mm = self.members[n].particle.place_mm[2];
        z_mm.abs() < criteria.near_mm && self.beside(n, [criteria.lenslet_px, HEIR]).next().is_some()
    }

    /// The brightest particle with which another may be one.
    fn twin(&self, n: usize) -> Option<Particle> {
        self.beside(n, TWIN).max_by(|a, b| a.light.total_cmp(&b.light))
    }

    /// The other particles within these pixels of one, sideways and in depth.
    fn beside(&self, n: usize, [aside, deep]: [f64; 2]) -> impl Iterator<Item = Particle> {
        let [x, y, z] = self.members[n].particle.place_mm;
        let px = self.cameras.pixel_mm();
        let is_near = move |particle: &Particle| {
            let [a, b, c] = particle.place_mm;
            (a - x).hypot(b - y) < aside * px && (c - z).abs() < deep * px
        };
        let others = self.members.iter().enumerate().filter(move |(other, _)| *other != n);
        others.map(|(_, member)| member.particle).filter(is_near)
    }

    /// The fall of -2 log L by a particle and its twin, if noise grows with their light. 0 without a twin.
    fn strength_of_twins(&self, n: usize) -> f64 {
        let Some(twin) = self.twin(n) else { return 0.0 };
        let [_, square] = along_residual(self.cameras, self.window, &self.members[n].image);
        square * (1.0 + twin.light / self.members[n].particle.light)
    }

    /// Gives the light of a dropped particle to the nearest one of the rest, and moves that one towards it.
    fn inherit(&self, particle: &Particle, rest: &mut [Particle], criteria: &Criteria) {
        let px = self.cameras.pixel_mm();
        let off =
            |other: &Particle| std::array::from_fn::<f64, 3, _>(|k| (particle.place_mm[k] - other.place_mm[k]) / px);
        let far = |other: &Particle| {
            let [x, y, z] = off(other);
            x.hypot(y) + DEPTH_WEIGHT * z.abs()
        };
        let Some(heir) = rest.iter_mut().min_by(|a, b| far(a).total_cmp(&far(b))) else { return };
        let [x, y, z] = off(heir);
        if x.hypot(y) < criteria.lenslet_px && z.abs() < HEIR {
            let share = particle.light / (particle.light + heir.light);
            (0..3).for_each(|k| heir.place_mm[k] += share * (particle.place_mm[k] - heir.place_mm[k]));
            heir.light += particle.light;
        }
    }

    /// Splits own particles that fit badly or are bright. Returns their number.
    pub(crate) fn split(&mut self, criteria: &Criteria) -> usize {
        let bad = |tile: &Self, n: usize| {
            let member = &tile.members[n];
            let is_bright = member.particle.light > BRIGHT * criteria.usual_light;
            let excess = tile.excess(n);
            let is_asked = member.is_own && !member.is_whole && (excess > MISFIT || is_bright);
            is_asked.then_some(excess + if is_bright { BRIGHT_FIRST } else { 0.0 })
        };
        let mut todo: Vec<(f64, Particle)> = (0..self.members.len())
            .filter_map(|n| bad(self, n).map(|badness| (badness, self.members[n].particle)))
            .collect();
        todo.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut count = 0;
        for (_, particle) in todo {
            let Some(n) = self.number(&particle) else { continue };
            if bad(self, n).is_none() {
                continue;
            }
            // Fit the whole particles again first: a gain of that fit is no reason to split.
            let near = self.near(particle.place_mm, criteria.lenslet_px);
            let particles = self.particles(&near);
            let (fitted, gain) = self.attempt(&near, &particles, TRIAL);
            if gain > TRIAL.gain {
                self.keep(&near, fitted, particle.place_mm);
            }
            if bad(self, n).is_none() {
                continue;
            }
            if self.split_one(n, criteria) {
                count += 1;
            } else {
                self.members[n].is_whole = true;
            }
        }
        count
    }

    /// Tries to split a member in several ways. Returns whether the best one is kept.
    fn split_one(&mut self, n: usize, criteria: &Criteria) -> bool {
        let particle = self.members[n].particle;
        let px = self.cameras.pixel_mm();
        // Compare the ways with the neighbours held.
        let mut best: Option<(f64, Vec<Particle>)> = None;
        for half in HALVES {
            let moved = |sign: f64| {
                let place_mm = std::array::from_fn(|k| particle.place_mm[k] + sign * px * half[k]);
                Particle { place_mm, light: 0.5 * particle.light, ..particle }
            };
            let (fitted, gain) = self.attempt(&[n], &[moved(1.0), moved(-1.0)], BRIEF);
            if best.as_ref().is_none_or(|(most, _)| gain > *most) {
                best = Some((gain, fitted.particles));
            }
        }
        let Some((_, halves)) = best else { return false };

        // Fit the best one with them.
        let mut order = self.near(particle.place_mm, criteria.lenslet_px);
        order.retain(|other| *other != n);
        order.insert(0, n);
        let mut particles = self.particles(&order);
        particles[0] = halves[0];
        particles.push(halves[1]);
        let (fitted, gain) = self.attempt(&order, &particles, TRIAL);
        let is_kept = gain > criteria.gain;
        if is_kept {
            self.keep(&order, fitted, particle.place_mm);
        }
        is_kept
    }

    /// Adds candidates that the residual supports. Returns their number.
    pub(crate) fn add_candidates(&mut self, candidates: &[Particle], criteria: &Criteria) -> usize {
        // The matched filter of the residual, for candidates of the usual light.
        let usual = |particle: &Particle| Particle { light: criteria.usual_light, ..*particle };
        let tried: Vec<Particle> = candidates.iter().map(usual).collect();
        let (cameras, window) = (self.cameras, &*self.window);
        let scores = self.buffers.draw(&tried, |scratch, particle| {
            filter(cameras, window, &ParticleImage::light(cameras, particle, window, scratch))
        });
        let mut asked = Vec::new();
        for (particle, (score, factor)) in tried.into_iter().zip(scores) {
            if score > criteria.gain_of(factor) {
                asked.push((score, Particle { light: factor.min(BRIGHTEST_NEW) * criteria.usual_light, ..particle }));
            }
        }
        asked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut count = 0;
        let mut hit: Vec<[f64; 3]> = Vec::new();
        let apart = APART * self.cameras.pixel_mm();
        for (_, particle) in asked {
            if hit.iter().any(|place| (0..2).all(|k| (place[k] - particle.place_mm[k]).abs() < apart)) {
                continue;
            }
            hit.push(particle.place_mm);
            let near = self.near(particle.place_mm, criteria.lenslet_px);
            let mut particles = self.particles(&near);
            particles.push(particle);
            let (fitted, gain) = self.attempt(&near, &particles, TRIAL);
            let least = fitted.particles.last().map(|new| criteria.gain_of(new.light / criteria.usual_light));
            if least.is_some_and(|least| gain > least) {
                self.keep(&near, fitted, particle.place_mm);
                count += 1;
            }
        }
        count
    }

    /// Near focus -2 log L has several minima. Scans own particles there sideways and in depth, with their light held.
    /// Fits start from the best places, and the best fit stays. Returns the number of particles that moved.
    pub(crate) fn scan(&mut self, criteria: &Criteria) -> usize {
        let mut count = 0;
        let todo: Vec<Particle> = self
            .members
            .iter()
            .filter(|member| member.is_own && member.particle.place_mm[2].abs() < criteria.near_mm)
            .map(|member| member.particle)
            .collect();
        for particle in todo {
            let Some(n) = self.number(&particle) else { continue };
            if self.excess(n) < SCAN_MISFIT {
                continue;
            }
            let starts = self.scan_starts(n);
            let near = self.near(particle.place_mm, criteria.lenslet_px + SCAN_MARGIN_PX);
            let mut best: Option<(f64, Fitted)> = None;
            for start in starts {
                let mut particles = self.particles(&near);
                let at = near.iter().position(|other| *other == n).unwrap_or(0);
                particles[at] = start;
                let (fitted, gain) = self.attempt(&near, &particles, SCAN_TRIAL);
                if gain > SCAN_GAIN && best.as_ref().is_none_or(|(most, _)| gain > *most) {
                    best = Some((gain, fitted));
                }
            }
            if let Some((_, fitted)) = best {
                self.keep(&near, fitted, particle.place_mm);
                count += 1;
            }
        }
        count
    }

    /// The best places of a scan, apart from each other.
    fn scan_starts(&mut self, n: usize) -> Vec<Particle> {
        let particle = self.members[n].particle;
        let px = self.cameras.pixel_mm();
        self.subtract_light(&[n]);
        let mut tried = Vec::new();
        for z in SCAN_DEPTH {
            let steps: Vec<[f64; 3]> = SCAN_ASIDE.iter().flat_map(|y| SCAN_ASIDE.map(|x| [x, *y, z])).collect();
            let place = |step: &[f64; 3]| std::array::from_fn(|k| particle.place_mm[k] + px * step[k]);
            let places: Vec<Particle> =
                steps.iter().map(|step| Particle { place_mm: place(step), ..particle }).collect();
            let (cameras, window) = (self.cameras, &*self.window);
            let draw = |scratch: &mut _, there: &_| ParticleImage::light(cameras, there, window, scratch);
            let images = self.buffers.draw(&places, draw);
            for ((step, there), image) in steps.into_iter().zip(places).zip(&images) {
                let level = self.cameras.deviance(self.window, std::iter::once(image), self.buffers);
                tried.push((level, step, there));
            }
        }
        self.add_light(&[n]);
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Vec<([f64; 3], Particle)> = Vec::new();
        for (_, step, particle) in tried {
            let is_beside = |other: &[f64; 3]| (0..3).all(|k| (step[k] - other[k]).abs() < SCAN_APART[k]);
            if !best.iter().any(|(other, _)| is_beside(other)) {
                best.push((step, particle));
            }
            if best.len() == SCAN_BEST {
                break;
            }
        }
        best.into_iter().map(|(_, particle)| particle).collect()
    }
}
