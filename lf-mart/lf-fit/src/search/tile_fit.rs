//! The particles of a tile and of its seam, and trials of changes among them.

use super::particles::{Members, Particles};
use super::tiles::{SEAM, Tile, TilePlan};
use crate::cameras::view::Cameras;
use crate::model::buffers::FitBuffers;
use crate::model::particle_image::{COUNTS, ParticleImage, UNKNOWNS};
use crate::model::window::Window;
use crate::particle::{FoundParticle, Particle};
use crate::solve::covariance::{Prior, covariance};
use crate::solve::joint::{Fitted, StopRule};
use crate::solve::normal::Normal;
use crate::solve::parts::Pull;
use crate::solve::size::{SizeEquation, SizeSpread, SizeSums};
use rayon::prelude::*;

/// A particle that the tile's work may change.
#[derive(Debug, Clone)]
pub(crate) struct Member {
    /// Its number among all particles; None for a new one.
    pub(crate) number: Option<usize>,
    /// Whether the tile, and not its seam, holds it, and a round works on it.
    pub(crate) is_own: bool,
    pub(crate) particle: Particle,
    pub(crate) image: ParticleImage,
    /// Whether it stayed whole when it was tried to be two, and nothing changed near it since.
    pub(crate) is_whole: bool,
    /// Whether the next round works on it.
    is_awake: bool,
}

/// Work on a tile.
pub(crate) struct TileFit<'a, 'b> {
    pub(crate) cameras: &'a Cameras<'a>,
    pub(crate) window: &'a mut Window,
    pub(crate) members: Vec<Member>,
    pub(crate) buffers: &'b mut FitBuffers,
    /// Numbers of particles that are gone.
    gone: Vec<usize>,
    /// Where something changed.
    places: Vec<[f64; 3]>,
    tile: Tile,
    /// The number of the tile.
    pub(crate) place: usize,
}

/// Normal equations of some members.
pub(crate) struct Equations {
    normal: Normal,
    /// Their numbers, rising.
    members: Vec<usize>,
}

/// The changes by a tile's work.
#[derive(Debug, Default)]
pub(crate) struct Changed {
    pub(crate) particles: Vec<(usize, Particle, State)>,
    pub(crate) gone: Vec<usize>,
    pub(crate) new: Vec<Particle>,
    /// Where particles were dropped, split, added or moved into another minimum.
    pub(crate) places: Vec<[f64; 3]>,
}

/// The state of a particle between rounds: whether it stayed whole, and whether the next round works on it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct State {
    is_whole: bool,
    is_awake: bool,
}

/// Neighbours within these pixels of the focal plane are free when the covariance is found: 0.995 of the full.
const NEIGHBOURS_PX: f64 = 28.0;
/// The misfit of a particle counts the pixels with more than this share of its light.
const LIT_SHARE: f64 = 1e-4;

impl<'a, 'b> TileFit<'a, 'b> {
    pub(crate) fn new(
        all: &'a Particles<'a>,
        window: &'a mut Window,
        tile: &Tile,
        members: Members,
        buffers: &'b mut FitBuffers,
    ) -> Self {
        let cameras = &all.cameras;
        buffers.fit(window.seen.len());
        let (gone, places) = (Vec::new(), Vec::new());
        let mut tile_fit =
            Self { cameras, window, members: Vec::new(), buffers, gone, places, tile: *tile, place: members.own };
        let awake = members.own().iter().filter(|n| all.is_awake[**n]);
        let awake: Vec<[f64; 3]> = awake.map(|n| all.list[*n].place_mm).collect();
        let is_near =
            |particle: &Particle| awake.iter().any(|at| cameras.is_beside(particle.place_mm, *at, all.beside_px));
        let is_taken = |(n, is_of_tile): &(usize, bool)| {
            let particle = &all.list[*n];
            let is_beside = particle.light > 0.0 && (*is_of_tile || tile_fit.is_in_seam(particle));
            *is_of_tile && all.is_awake[*n] || is_beside && is_near(particle)
        };
        let taken: Vec<(usize, bool)> = members.about().into_iter().filter(is_taken).collect();
        let window = &*tile_fit.window;
        tile_fit.members = tile_fit.buffers.draw(&taken, |scratch, (n, is_of_tile)| {
            let (particle, is_whole, is_awake) = (all.list[*n], all.is_whole[*n], all.is_awake[*n]);
            let image = ParticleImage::new(cameras, &particle, window, scratch);
            Member { number: Some(*n), is_own: *is_of_tile && is_awake, particle, image, is_whole, is_awake }
        });
        tile_fit
    }

    /// Whether a particle lies within half a seam of the tile.
    fn is_in_seam(&self, particle: &Particle) -> bool {
        let place = self.cameras.first().model.chief_px(particle.place_mm);
        let seam = SEAM as f64 / 2.0;
        (0..2).all(|axis| {
            let (low, high) = (self.tile.low[axis] as f64, self.tile.high[axis] as f64);
            place[axis] > low - seam && place[axis] < high + seam
        })
    }

    /// Particles within `aside` pixels of the focal plane of a place, sideways for any of the cameras.
    pub(crate) fn near(&self, place_mm: [f64; 3], aside: f64) -> Vec<usize> {
        let is_near = |n: &usize| self.cameras.is_beside(self.members[*n].particle.place_mm, place_mm, aside);
        (0..self.members.len()).filter(is_near).collect()
    }

    /// Fits `particles` in the place of the members `near`. Returns the fit and the fall of -2 log L. Nothing
    /// changes yet.
    pub(crate) fn attempt(&mut self, near: &[usize], particles: &[Particle], rule: StopRule) -> (Fitted, f64) {
        let before = self.subtract_light(near);
        let (cameras, window, members) = (self.cameras, &*self.window, &self.members);
        let images = self.buffers.draw(particles, |scratch, particle| {
            let known = near.iter().map(|n| &members[*n]).find(|member| member.particle == *particle);
            match known {
                Some(member) => member.image.clone(),
                None => ParticleImage::new(cameras, particle, window, scratch),
            }
        });
        let fitted = self.cameras.joint(self.window, particles, images, rule, self.buffers);
        self.add_light(near);
        let gain = before - fitted.deviance;
        (fitted, gain)
    }

    /// Takes the light of members out of the window. Returns their -2 log L minus that of the window without them.
    pub(crate) fn subtract_light(&mut self, near: &[usize]) -> f64 {
        let images = near.iter().map(|n| &self.members[*n].image);
        images.clone().for_each(|image| image.add_to(&mut self.window.light, self.window.columns, -1.0));
        self.cameras.deviance(self.window, images, self.buffers)
    }

    /// Puts the light of members back into the window.
    pub(crate) fn add_light(&mut self, near: &[usize]) {
        for n in near {
            self.members[*n].image.add_to(&mut self.window.light, self.window.columns, 1.0);
        }
    }

    /// Keeps a fit: its first particles take the numbers of `near`, further ones are new. Spare members of `near` go.
    /// `about` is the place of the change.
    pub(crate) fn keep(&mut self, near: &[usize], fitted: Fitted, about: [f64; 3]) {
        self.places.push(about);
        let images = near.iter().map(|n| &self.members[*n].image);
        images.for_each(|image| image.add_to(&mut self.window.light, self.window.columns, -1.0));
        let (count, old) = (fitted.particles.len(), near.len());
        for (k, (particle, image)) in fitted.particles.into_iter().zip(fitted.images).enumerate() {
            image.add_to(&mut self.window.light, self.window.columns, 1.0);
            if k < old {
                let member = &mut self.members[near[k]];
                (member.particle, member.image, member.is_whole, member.is_awake) = (particle, image, false, true);
            } else {
                let (number, is_own, is_whole, is_awake) = (None, true, false, true);
                self.members.push(Member { number, is_own, particle, image, is_whole, is_awake });
            }
        }
        let mut spare: Vec<usize> = near.iter().skip(count).copied().collect();
        spare.sort_unstable();
        for n in spare.into_iter().rev() {
            self.gone.extend(self.members.remove(n).number);
        }
    }

    /// Fits all own members together, and notes which of them still move. Returns the fall of -2 log L.
    pub(crate) fn fit(&mut self, rule: StopRule) -> f64 {
        let own: Vec<usize> = (0..self.members.len()).filter(|n| self.members[*n].is_own).collect();
        let before = self.subtract_light(&own);
        let particles: Vec<Particle> = own.iter().map(|n| self.members[*n].particle).collect();
        let images = own.iter().map(|n| std::mem::take(&mut self.members[*n].image)).collect();
        let rule = rule.times(own.len());
        let fitted = self.cameras.joint(self.window, &particles, images, rule, self.buffers);
        for (k, (particle, image)) in fitted.particles.into_iter().zip(fitted.images).enumerate() {
            let member = &mut self.members[own[k]];
            (member.particle, member.image, member.is_awake) = (particle, image, fitted.is_busy[k]);
        }
        self.add_light(&own);
        before - fitted.deviance
    }

    /// The normal equations of some members, for their covariances.
    pub(crate) fn equations(&mut self, members: Vec<usize>) -> Equations {
        let images = members.iter().map(|n| &self.members[*n].image);
        self.buffers.paint(images.clone(), self.window.columns);
        self.cameras.weigh_whole(self.window, self.buffers);
        let normal = Normal::new(images, self.window.columns, self.buffers);
        self.buffers.wipe();
        Equations { normal, members }
    }

    /// The covariance of a member. Its neighbours within `aside` pixels are free too.
    pub(crate) fn covariance(
        &self,
        equations: &Equations,
        n: usize,
        aside: f64,
        prior: Prior,
    ) -> [[f64; UNKNOWNS]; UNKNOWNS] {
        covariance(&equations.normal, &self.chosen(equations, n, aside), prior)
    }

    /// Places of a member and of its neighbours within `aside` pixels in the equations, its own first.
    fn chosen(&self, equations: &Equations, n: usize, aside: f64) -> Vec<usize> {
        let mut chosen = self.near(self.members[n].particle.place_mm, aside);
        chosen.retain(|other| *other != n);
        chosen.insert(0, n);
        chosen.iter().filter_map(|n| equations.members.binary_search(n).ok()).collect()
    }

    /// The equation of a member's size.
    pub(crate) fn size_equation(&mut self, equations: &Equations, n: usize, prior: Prior) -> SizeEquation {
        let chosen = self.chosen(equations, n, NEIGHBOURS_PX);
        let FitBuffers { scratch, by_size, weight, residual, .. } = &mut *self.buffers;
        let (_, slopes) = ParticleImage::with_slopes(self.cameras, &self.members[n].particle, self.window, scratch);
        // A pixel may come more than once.
        by_size.resize(by_size.len().max(self.window.seen.len()), 0.0);
        slopes.iter().for_each(|(at, slopes)| by_size[*at as usize] += slopes[0]);
        let sigma_px = self.cameras.first().shape.sigma_px;
        let mut sums = SizeSums { right: 0.0, square: 0.0, mixed: Vec::with_capacity(UNKNOWNS * chosen.len()) };
        for (at, slopes) in &slopes {
            let (at, slope) = (*at as usize, sigma_px * f64::from(slopes[0]));
            sums.square += slope * sigma_px * f64::from(weight[at] * by_size[at]);
            sums.right += slope * f64::from(residual[at]);
        }
        for place in &chosen {
            let image = &self.members[equations.members[*place]].image;
            let mixed = image.products(self.window.columns, |at| weight[at] * by_size[at]);
            sums.mixed.extend(mixed.map(|sum| sigma_px * sum));
        }
        slopes.iter().for_each(|(at, _)| by_size[*at as usize] = 0.0);
        SizeEquation::new(sums, &equations.normal, &chosen, prior)
    }

    /// A member with its uncertainties.
    fn found(&mut self, equations: &Equations, n: usize, sizes: Option<SizeSpread>, prior: Prior) -> FoundParticle {
        let mut covariance = self.covariance(equations, n, NEIGHBOURS_PX, prior);
        if let Some(spread) = sizes {
            let more = self.size_equation(equations, n, prior).covariance(spread);
            covariance.iter_mut().flatten().zip(more.iter().flatten()).for_each(|(sum, more)| *sum += more);
        }
        let particle = self.members[n].particle;
        let square = self.cameras.pixel_mm() * self.cameras.pixel_mm();
        let at = |a: usize, b: usize| square * 0.5 * (covariance[a][b] + covariance[b][a]);
        FoundParticle {
            particle,
            covariance_mm2: [at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2)],
            light_std: particle.light * covariance[COUNTS][COUNTS].sqrt(),
        }
    }

    /// Misfit on a member's light, in standard deviations of chi squared.
    pub(crate) fn excess(&self, n: usize) -> f64 {
        let member = &self.members[n];
        let least = (LIT_SHARE * member.particle.light) as f32;
        let (mut sum, mut count) = (0.0, 0.0);
        member.image.pixels(self.window.columns, |n, pixel| {
            let (seen, light) = (self.window.seen[n], self.window.light[n]);
            if pixel[COUNTS] > least && !seen.is_nan() {
                sum += f64::from((seen - light).powi(2) / self.window.noise(self.cameras, n).variance(light)) - 1.0;
                count += 1.0;
            }
        });
        sum / f64::sqrt(2.0 * f64::max(count, 1.0))
    }

    /// The changes by the work.
    pub(crate) fn changed(self) -> Changed {
        let mut changed = Changed { gone: self.gone, places: self.places, ..Changed::default() };
        for member in self.members {
            let state = State { is_whole: member.is_whole, is_awake: member.is_awake };
            match member.number {
                Some(number) => changed.particles.push((number, member.particle, state)),
                None => changed.new.push(member.particle),
            }
        }
        changed
    }
}

impl Particles<'_> {
    /// All particles with their uncertainties, and how far the parts of each image pull.
    pub(crate) fn uncertainties(&self, prior: Prior) -> (Vec<FoundParticle>, Vec<Option<Pull>>) {
        let each = self.of_each(|tile, equations, n| {
            let pull = Pull::new(&tile.members[n].image, tile.window, tile.cameras);
            (tile.found(equations, n, self.size_spread, prior), pull)
        });
        each.into_iter().unzip()
    }

    /// Calls `find` for each particle that is awake, with the equations of its tile, tile by tile.
    pub(super) fn of_each<T: Clone + Send>(
        &self,
        find: impl Fn(&mut TileFit, &Equations, usize) -> T + Sync,
    ) -> Vec<T> {
        let TilePlan { tiles, windows, members, .. } = self.plan();
        let buffers = || FitBuffers::beside(tiles.len());
        let found: Vec<Vec<T>> = (0..tiles.len())
            .into_par_iter()
            .map_init(buffers, |buffers, own| {
                let mut window = Window::cut(&self.cameras.views, &windows[own]);
                let members = Members { tiles: &tiles, lists: &members, own };
                let mut tile = TileFit::new(self, &mut window, &tiles[own], members, buffers);
                let equations = tile.equations((0..tile.members.len()).collect());
                let own: Vec<usize> = (0..tile.members.len()).filter(|n| tile.members[*n].is_own).collect();
                own.into_iter().map(|n| find(&mut tile, &equations, n)).collect()
            })
            .collect();
        found.concat()
    }

    /// Takes changes. Numbers of particles stay valid until [`Particles::forget`].
    pub(crate) fn take(&mut self, changed: &Changed) {
        for (n, particle, state) in &changed.particles {
            (self.list[*n], self.is_whole[*n], self.is_awake[*n]) = (*particle, state.is_whole, state.is_awake);
        }
        self.list.extend(&changed.new);
        self.is_whole.resize(self.list.len(), false);
        self.is_awake.resize(self.list.len(), true);
        changed.gone.iter().for_each(|n| self.list[*n].light = 0.0);
    }

    /// Forgets particles without light.
    pub(crate) fn forget(&mut self) {
        for states in [&mut self.is_whole, &mut self.is_awake] {
            let mut kept = self.list.iter().map(|particle| particle.light > 0.0);
            states.retain(|_| kept.next().unwrap_or(false));
        }
        self.list.retain(|particle| particle.light > 0.0);
    }
}
