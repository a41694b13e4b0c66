//! The particles of a tile and of its seam, and trials of changes among them.

use super::buffers::Buffers;
use super::cloud::{Cloud, Members, SEAM, Tile};
use super::covariance::{Prior, covariance};
use super::image::{COUNTS, SpotImage, UNKNOWNS};
use super::joint::{Ends, Fitted, Setting};
use super::normal::Normal;
use super::{spot::Spot, window::Window};

/// A particle in hand.
#[derive(Debug, Clone)]
pub(super) struct Member {
    /// Its number in the cloud; None for a new one.
    pub(super) number: Option<usize>,
    /// Whether the tile, and not its seam, holds it, and a round works on it.
    pub(super) is_own: bool,
    pub(super) spot: Spot,
    pub(super) image: SpotImage,
    /// Whether it stayed whole when it was tried to be two, and nothing changed near it since.
    pub(super) is_whole: bool,
    /// Whether the next round works on it.
    is_awake: bool,
}

/// A tile at work.
pub(super) struct Local<'a, 'b> {
    pub(super) setting: &'a Setting<'a>,
    pub(super) window: &'a mut Window,
    pub(super) members: Vec<Member>,
    pub(super) buffers: &'b mut Buffers,
    /// Numbers of particles that are gone.
    gone: Vec<usize>,
    /// Where something changed.
    places: Vec<[f64; 3]>,
    tile: Tile,
    /// The number of the tile.
    pub(super) place: usize,
}

/// The changes by a tile's work.
#[derive(Debug, Default)]
pub(super) struct Changed {
    pub(super) spots: Vec<(usize, Spot, State)>,
    pub(super) gone: Vec<usize>,
    pub(super) new: Vec<Spot>,
    /// Where particles were dropped, split, added or moved into another minimum.
    pub(super) places: Vec<[f64; 3]>,
}

/// The state of a particle between rounds: whether it stayed whole, and whether the next round works on it.
#[derive(Debug, Clone, Copy)]
pub(super) struct State {
    is_whole: bool,
    is_awake: bool,
}

impl<'a, 'b> Local<'a, 'b> {
    pub(super) fn new(
        cloud: &Cloud,
        setting: &'a Setting<'a>,
        window: &'a mut Window,
        tile: &Tile,
        members: Members,
        buffers: &'b mut Buffers,
    ) -> Self {
        buffers.fit(window.seen.len());
        let (gone, places) = (Vec::new(), Vec::new());
        let mut local =
            Self { setting, window, members: Vec::new(), buffers, gone, places, tile: *tile, place: members.own };
        let awake = members.own().iter().filter(|n| cloud.is_awake[**n]);
        let awake: Vec<[f64; 3]> = awake.map(|n| cloud.spots[*n].place_mm).collect();
        let is_near = |spot: &Spot| awake.iter().any(|at| setting.is_beside(spot.place_mm, *at, cloud.beside_px));
        for (n, is_of_tile) in members.about() {
            let (spot, is_awake) = (&cloud.spots[n], cloud.is_awake[n]);
            let is_own = is_of_tile && is_awake;
            let is_lit = spot.light > 0.0;
            if is_own || (is_lit && (is_of_tile || local.is_in_seam(spot)) && is_near(spot)) {
                let image = setting.image(spot, local.window, local.buffers);
                let is_whole = cloud.is_whole[n];
                local.members.push(Member { number: Some(n), is_own, spot: *spot, image, is_whole, is_awake });
            }
        }
        local
    }

    /// Whether a particle lies within half a seam of the tile.
    fn is_in_seam(&self, spot: &Spot) -> bool {
        let place = self.setting.model.chief_px(spot.place_mm);
        let seam = SEAM as f64 / 2.0;
        (0..2).all(|axis| {
            let (low, high) = (self.tile.low[axis] as f64, self.tile.high[axis] as f64);
            place[axis] > low - seam && place[axis] < high + seam
        })
    }

    /// Particles within `aside` pixels of the focal plane of a place, sideways for any of the cameras.
    pub(super) fn near(&self, place_mm: [f64; 3], aside: f64) -> Vec<usize> {
        let is_near = |n: &usize| self.setting.is_beside(self.members[*n].spot.place_mm, place_mm, aside);
        (0..self.members.len()).filter(is_near).collect()
    }

    /// Fits `spots` in the place of the members `near`. Gives the fit and the fall of -2 log L. Nothing changes yet.
    pub(super) fn attempt(&mut self, near: &[usize], spots: &[Spot], ends: Ends) -> (Fitted, f64) {
        let before = self.lift(near);
        let mut images = Vec::with_capacity(spots.len());
        for spot in spots {
            let known = near.iter().map(|n| &self.members[*n]).find(|member| member.spot == *spot);
            images.push(match known {
                Some(member) => member.image.clone(),
                None => self.setting.image(spot, self.window, self.buffers),
            });
        }
        let fitted = self.setting.joint(self.window, spots, images, ends, self.buffers);
        self.lay(near);
        let gain = before - fitted.deviance;
        (fitted, gain)
    }

    /// Takes the light of members out of the window; gives their -2 log L beyond that of the window without them.
    pub(super) fn lift(&mut self, near: &[usize]) -> f64 {
        let images = near.iter().map(|n| &self.members[*n].image);
        images.clone().for_each(|image| image.add_to(&mut self.window.light, self.window.columns, -1.0));
        self.setting.deviance(self.window, images, self.buffers)
    }

    /// Puts it back.
    pub(super) fn lay(&mut self, near: &[usize]) {
        for n in near {
            self.members[*n].image.add_to(&mut self.window.light, self.window.columns, 1.0);
        }
    }

    /// Makes a fit hold: the first of its spots take the numbers of `near`, further ones are new. Members of `near`
    /// beyond its spots go. `about` is where the change was.
    pub(super) fn keep(&mut self, near: &[usize], fitted: Fitted, about: [f64; 3]) {
        self.places.push(about);
        for n in near {
            self.members[*n].image.add_to(&mut self.window.light, self.window.columns, -1.0);
        }
        let (count, old) = (fitted.spots.len(), near.len());
        for (k, (spot, image)) in fitted.spots.into_iter().zip(fitted.images).enumerate() {
            image.add_to(&mut self.window.light, self.window.columns, 1.0);
            if k < old {
                let member = &mut self.members[near[k]];
                (member.spot, member.image, member.is_whole, member.is_awake) = (spot, image, false, true);
            } else {
                let (number, is_own, is_whole, is_awake) = (None, true, false, true);
                self.members.push(Member { number, is_own, spot, image, is_whole, is_awake });
            }
        }
        let mut spare: Vec<usize> = near.iter().skip(count).copied().collect();
        spare.sort_unstable();
        for n in spare.into_iter().rev() {
            self.gone.extend(self.members.remove(n).number);
        }
    }

    /// Fits all own members together, and notes which of them still move. Gives the fall of -2 log L.
    pub(super) fn fit(&mut self, ends: Ends) -> f64 {
        let own: Vec<usize> = (0..self.members.len()).filter(|n| self.members[*n].is_own).collect();
        let before = self.lift(&own);
        let spots: Vec<Spot> = own.iter().map(|n| self.members[*n].spot).collect();
        let images = own.iter().map(|n| std::mem::take(&mut self.members[*n].image)).collect();
        let ends = Ends { gain: ends.gain * own.len() as f64, ..ends };
        let fitted = self.setting.joint(self.window, &spots, images, ends, self.buffers);
        for (k, (spot, image)) in fitted.spots.into_iter().zip(fitted.images).enumerate() {
            let member = &mut self.members[own[k]];
            (member.spot, member.image, member.is_awake) = (spot, image, fitted.is_busy[k]);
        }
        self.lay(&own);
        before - fitted.deviance
    }

    /// The normal equations of some members, for their covariances.
    pub(super) fn normal(&mut self, chosen: &[usize]) -> Normal {
        let images = chosen.iter().map(|n| &self.members[*n].image);
        self.buffers.paint(images.clone(), self.window.columns);
        self.setting.weigh_whole(self.window, self.buffers);
        let normal = Normal::new(images, self.window.columns, self.buffers);
        self.buffers.wipe();
        normal
    }

    /// The covariance of a member, its neighbours within `aside` pixels free too. `listed` are the members of the
    /// equations, rising.
    pub(super) fn covariance(
        &self,
        (normal, listed): (&Normal, &[usize]),
        n: usize,
        aside: f64,
        prior: Prior,
    ) -> [[f64; UNKNOWNS]; UNKNOWNS] {
        let mut chosen = self.near(self.members[n].spot.place_mm, aside);
        chosen.retain(|other| *other != n);
        chosen.insert(0, n);
        let places: Vec<usize> = chosen.iter().filter_map(|n| listed.binary_search(n).ok()).collect();
        covariance(normal, &places, prior)
    }

    /// Misfit on a member's light, in standard deviations of chi squared.
    pub(super) fn excess(&self, n: usize) -> f64 {
        let member = &self.members[n];
        let least = (1e-4 * member.spot.light) as f32;
        let (mut sum, mut count) = (0.0, 0.0);
        member.image.pixels(self.window.columns, |n, pixel| {
            let (seen, light) = (self.window.seen[n], self.window.light[n]);
            if pixel[COUNTS] > least && !seen.is_nan() {
                sum += f64::from((seen - light).powi(2) / self.setting.noise_at(self.window, n).variance(light)) - 1.0;
                count += 1.0;
            }
        });
        sum / f64::sqrt(2.0 * f64::max(count, 1.0))
    }

    /// The changes by the work.
    pub(super) fn changed(self) -> Changed {
        let mut changed = Changed { gone: self.gone, places: self.places, ..Changed::default() };
        for member in self.members {
            let state = State { is_whole: member.is_whole, is_awake: member.is_awake };
            match member.number {
                Some(number) => changed.spots.push((number, member.spot, state)),
                None => changed.new.push(member.spot),
            }
        }
        changed
    }
}

impl Cloud<'_> {
    /// Takes changes in. Numbers of particles hold until [`Cloud::forget`].
    pub(super) fn take(&mut self, changed: &Changed) {
        for (n, spot, state) in &changed.spots {
            (self.spots[*n], self.is_whole[*n], self.is_awake[*n]) = (*spot, state.is_whole, state.is_awake);
        }
        self.spots.extend(&changed.new);
        self.is_whole.resize(self.spots.len(), false);
        self.is_awake.resize(self.spots.len(), true);
        changed.gone.iter().for_each(|n| self.spots[*n].light = 0.0);
    }

    /// Forgets particles without light.
    pub(super) fn forget(&mut self) {
        for states in [&mut self.is_whole, &mut self.is_awake] {
            let mut kept = self.spots.iter().map(|spot| spot.light > 0.0);
            states.retain(|_| kept.next().unwrap_or(false));
        }
        self.spots.retain(|spot| spot.light > 0.0);
    }
}
