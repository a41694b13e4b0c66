//! Changes of the number of particles, and of places in another minimum: drop, split, add, scan. Each is judged by a
//! fit of the particles within a lenslet, and kept if -2 log L falls by enough.

use super::covariance::Prior;
use super::joint::Ends;
use super::local::{Local, Member};
use super::spot::Spot;

/// The measures by which changes are judged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Judge {
    /// Least fall of -2 log L for another particle.
    pub(super) gain: f64,
    /// Light of a usual particle.
    pub(super) usual_light: f64,
    /// Pixels of the focal plane in a lenslet.
    pub(super) lenslet_px: f64,
    /// Depth from focus within which places have several minima, mm.
    pub(super) near_mm: f64,
    pub(super) prior: Prior,
}

const TRIAL: Ends = Ends { steps: 10, gain: 0.5 };
const BRIEF: Ends = Ends { steps: 2, gain: 0.5 };
/// Misfit, in standard deviations, and light over the usual, beyond which a particle may be two.
const MISFIT: f64 = 4.0;
const BRIGHT: f64 = 1.5;
/// Halves of a split lie this far from the middle, pixels of the focal plane.
const HALVES: [[f64; 3]; 7] = [
    [3.0, 0.0, 0.0],
    [0.0, 3.0, 0.0],
    [0.0, 0.0, 15.0],
    [3.0, 3.0, 20.0],
    [3.0, -3.0, 20.0],
    [-3.0, 3.0, 20.0],
    [-3.0, -3.0, 20.0],
];
/// Most passes of drops in a round.
const DROPS: usize = 6;
/// Farthest in depth of a neighbour that takes a dropped particle's light, pixels of the focal plane.
const HEIR: f64 = 150.0;
/// Two particles within these pixels, sideways and in depth, are one that the model does not draw quite right, and so
/// are a faint one and its neighbour. They go for this many times the loss that another may bring.
const TWIN: [f64; 2] = [2.0, 20.0];
const SPARE: f64 = 10.0;
/// Faintest new particle, in the usual light.
const FAINT: f64 = 0.2;
/// Scan near focus: depths within which particles are scanned, mm at an f-number of 4 and m = 1; steps in pixels.
const SCAN_ASIDE: [f64; 7] = [-9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0];
const SCAN_DEPTH: [f64; 9] = [-84.0, -63.0, -42.0, -21.0, 0.0, 21.0, 42.0, 63.0, 84.0];
const SCAN_BEST: usize = 3;
const SCAN_GAIN: f64 = 1.0;
/// Misfit, in standard deviations, from which a particle near focus is scanned.
const SCAN_MISFIT: f64 = 0.5;

impl Local<'_, '_> {
    /// Drops own particles whose light the image does not support, until all do or none can be spared. Gives how many.
    /// With `pairs`, one of two near focus within a lenslet is tried too, as strong as both may be.
    pub(super) fn drop_weak(&mut self, judge: &Judge, pairs: bool) -> usize {
        let own = |local: &Self, n: usize| local.members[n].is_own;
        let mut asked: Vec<usize> = (0..self.members.len()).filter(|n| own(self, *n)).collect();
        let mut dropped = 0;
        for round in 0..DROPS {
            let hit = self.drop_apart(&asked, judge, pairs && round == 0);
            dropped += hit.len();
            // Only the neighbours of what is gone may have become weak, or were spared for its sake.
            asked = hit.iter().flat_map(|place| self.near(*place, 2.0 * judge.lenslet_px)).collect();
            asked.sort_unstable();
            asked.dedup();
            asked.retain(|n| own(self, *n));
            if asked.is_empty() {
                break;
            }
        }
        dropped
    }

    /// Drops those of the members `asked` that are weak and lie more than a lenslet apart. Gives where they were.
    fn drop_apart(&mut self, asked: &[usize], judge: &Judge, pairs: bool) -> Vec<[f64; 3]> {
        let mut weak = Vec::new();
        let about = |n: &usize| self.near(self.members[*n].spot.place_mm, judge.lenslet_px);
        let mut listed: Vec<usize> = asked.iter().flat_map(about).collect();
        listed.sort_unstable();
        listed.dedup();
        let normal = self.normal(&listed);
        for &n in asked {
            let spot = self.members[n].spot;
            if self.members[n].image.is_dark() {
                weak.push((0.0, spot));
                continue;
            }
            let variance = self.covariance((&normal, &listed), n, judge.lenslet_px, judge.prior)[3][3];
            if 1.0 / variance < judge.gain || (pairs && self.is_paired(n, judge)) {
                weak.push((1.0 / variance, spot));
            }
        }
        weak.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut hit: Vec<[f64; 3]> = Vec::new();
        for (_, spot) in weak {
            let lenslet_mm = judge.lenslet_px * self.setting.pixel_mm;
            let is_hit = |place: &[f64; 3]| (0..2).all(|k| (place[k] - spot.place_mm[k]).abs() < lenslet_mm);
            let Some(n) = self.members.iter().position(|member| member.spot == spot) else { continue };
            if hit.iter().any(is_hit) {
                continue;
            }
            let near = self.near(spot.place_mm, judge.lenslet_px);
            // The dropped one comes last, so that it is the one that goes.
            let mut order: Vec<usize> = near.iter().copied().filter(|other| *other != n).collect();
            let mut rest: Vec<Spot> = order.iter().map(|n| self.members[*n].spot).collect();
            self.inherit(&spot, &mut rest, judge);
            order.push(n);
            let (fitted, gain) = self.attempt(&order, &rest, Ends { steps: 8, gain: 0.5 });
            let is_spare = spot.light < FAINT * judge.usual_light || self.is_beside(n, TWIN);
            if -gain < judge.gain * if is_spare { SPARE } else { 1.0 } {
                self.keep(&order, fitted, spot.place_mm);
                hit.push(spot.place_mm);
            }
        }
        hit
    }

    /// Whether a particle near focus has another beside it with which it may be one.
    fn is_paired(&self, n: usize, judge: &Judge) -> bool {
        self.members[n].spot.place_mm[2].abs() < judge.near_mm && self.is_beside(n, [judge.lenslet_px, HEIR])
    }

    /// Whether a particle has another within these pixels, sideways and in depth.
    fn is_beside(&self, n: usize, [aside, deep]: [f64; 2]) -> bool {
        let [x, y, z] = self.members[n].spot.place_mm;
        let px = self.setting.pixel_mm;
        let is_near = |member: &Member| {
            let [a, b, c] = member.spot.place_mm;
            (a - x).hypot(b - y) < aside * px && (c - z).abs() < deep * px
        };
        self.members.iter().enumerate().any(|(other, member)| other != n && is_near(member))
    }

    /// Gives the light of a dropped particle to the nearest of the rest, and moves that towards it.
    fn inherit(&self, spot: &Spot, rest: &mut [Spot], judge: &Judge) {
        let px = self.setting.pixel_mm;
        let off = |other: &Spot| std::array::from_fn::<f64, 3, _>(|k| (spot.place_mm[k] - other.place_mm[k]) / px);
        let far = |other: &Spot| {
            let [x, y, z] = off(other);
            x.hypot(y) + 0.1 * z.abs()
        };
        let Some(heir) = rest.iter_mut().min_by(|a, b| far(a).total_cmp(&far(b))) else { return };
        let [x, y, z] = off(heir);
        if x.hypot(y) < judge.lenslet_px && z.abs() < HEIR {
            let share = spot.light / (spot.light + heir.light);
            (0..3).for_each(|k| heir.place_mm[k] += share * (spot.place_mm[k] - heir.place_mm[k]));
            heir.light += spot.light;
        }
    }

    /// Splits own particles that fit badly or are bright. Gives how many.
    pub(super) fn split(&mut self, judge: &Judge) -> usize {
        let bad = |local: &Self, n: usize| {
            let member = &local.members[n];
            let is_bright = member.spot.light > BRIGHT * judge.usual_light;
            let excess = local.excess(n);
            let is_asked = member.is_own && !member.is_whole && (excess > MISFIT || is_bright);
            is_asked.then_some(excess + if is_bright { 20.0 } else { 0.0 })
        };
        let mut todo: Vec<(f64, Spot)> = (0..self.members.len())
            .filter_map(|n| bad(self, n).map(|badness| (badness, self.members[n].spot)))
            .collect();
        todo.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut count = 0;
        for (_, spot) in todo {
            // An earlier change may have moved it or cured it.
            let Some(n) = self.members.iter().position(|member| member.spot == spot) else { continue };
            if bad(self, n).is_none() {
                continue;
            }
            // A gain that a fit of the whole particles has as well is no reason to split.
            let near = self.near(spot.place_mm, judge.lenslet_px);
            let spots: Vec<Spot> = near.iter().map(|n| self.members[*n].spot).collect();
            let (fitted, gain) = self.attempt(&near, &spots, TRIAL);
            if gain > TRIAL.gain {
                self.keep(&near, fitted, spot.place_mm);
            }
            if bad(self, n).is_none() {
                continue;
            }
            if self.split_one(n, judge) {
                count += 1;
            } else {
                self.members[n].is_whole = true;
            }
        }
        count
    }

    fn split_one(&mut self, n: usize, judge: &Judge) -> bool {
        let spot = self.members[n].spot;
        let px = self.setting.pixel_mm;
        let near = self.near(spot.place_mm, judge.lenslet_px);
        let others: Vec<usize> = near.iter().copied().filter(|other| *other != n).collect();
        let order: Vec<usize> = std::iter::once(n).chain(others.iter().copied()).collect();
        let mut best: Option<(f64, Vec<Spot>)> = None;
        for half in HALVES {
            let moved = |sign: f64| {
                let place_mm = std::array::from_fn(|k| spot.place_mm[k] + sign * px * half[k]);
                Spot { place_mm, light: 0.5 * spot.light }
            };
            let mut spots = vec![moved(1.0)];
            spots.extend(others.iter().map(|n| self.members[*n].spot));
            spots.push(moved(-1.0));
            let (fitted, gain) = self.attempt(&order, &spots, BRIEF);
            if best.as_ref().is_none_or(|(most, _)| gain > *most) {
                best = Some((gain, fitted.spots));
            }
        }
        let Some((_, spots)) = best else { return false };
        let (fitted, gain) = self.attempt(&order, &spots, TRIAL);
        let is_kept = gain > judge.gain;
        if is_kept {
            self.keep(&order, fitted, spot.place_mm);
        }
        is_kept
    }

    /// Adds those of `candidates` that the residual asks for, or only those of them that lie near own particles. Gives
    /// how many.
    pub(super) fn add(&mut self, candidates: &[Spot], all: bool, judge: &Judge) -> usize {
        let mut asked = Vec::new();
        for spot in candidates {
            if !all && !self.near(spot.place_mm, judge.lenslet_px).iter().any(|n| self.members[*n].is_own) {
                continue;
            }
            let spot = Spot { light: judge.usual_light, ..*spot };
            let image = self.setting.image(&spot, self.window, self.buffers);
            let (score, factor) = self.filter(&image);
            if score > judge.gain && factor > FAINT {
                asked.push((score, Spot { light: factor.min(3.0) * judge.usual_light, ..spot }));
            }
        }
        asked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut count = 0;
        let mut hit: Vec<[f64; 3]> = Vec::new();
        let apart = 6.0 * self.setting.pixel_mm;
        for (_, spot) in asked {
            if hit.iter().any(|place| (0..2).all(|k| (place[k] - spot.place_mm[k]).abs() < apart)) {
                continue;
            }
            hit.push(spot.place_mm);
            let near = self.near(spot.place_mm, judge.lenslet_px);
            let mut spots: Vec<Spot> = near.iter().map(|n| self.members[*n].spot).collect();
            spots.push(spot);
            let (fitted, gain) = self.attempt(&near, &spots, TRIAL);
            if gain > judge.gain {
                self.keep(&near, fitted, spot.place_mm);
                count += 1;
            }
        }
        count
    }

    /// The matched filter of the residual: fall of -2 log L by a particle alone, and its light over that of the image.
    fn filter(&self, image: &super::image::SpotImage) -> (f64, f64) {
        let (mut along, mut square) = (0.0, 0.0);
        image.pixels(self.window.columns, |n, pixel| {
            let (seen, light) = (self.window.seen[n], self.window.light[n]);
            if !seen.is_nan() {
                let weight = f64::from(pixel[3] / self.setting.noise_at(self.window, n).variance(light));
                along += weight * f64::from(seen - light);
                square += weight * f64::from(pixel[3]);
            }
        });
        if along > 0.0 && square > 0.0 { (along * along / square, along / square) } else { (0.0, 0.0) }
    }

    /// Near focus -2 log L has several minima: own particles near it are scanned sideways and in depth,
    /// their light held. Local fits start from the best places; the best fit stays. Gives how many moved.
    pub(super) fn scan(&mut self, judge: &Judge) -> usize {
        let mut count = 0;
        let todo: Vec<Spot> = self
            .members
            .iter()
            .filter(|member| member.is_own && member.spot.place_mm[2].abs() < judge.near_mm)
            .map(|member| member.spot)
            .collect();
        for spot in todo {
            let Some(n) = self.members.iter().position(|member| member.spot == spot) else { continue };
            if self.excess(n) < SCAN_MISFIT {
                continue;
            }
            let starts = self.scan_starts(n);
            let near = self.near(spot.place_mm, judge.lenslet_px + 2.0);
            let mut best: Option<(f64, super::joint::Fitted)> = None;
            for start in starts {
                let place = |n: &usize| self.members[*n].spot;
                let mut spots: Vec<Spot> = near.iter().map(place).collect();
                let at = near.iter().position(|other| *other == n).unwrap_or(0);
                spots[at] = start;
                let (fitted, gain) = self.attempt(&near, &spots, Ends { steps: 15, gain: 0.5 });
                if gain > SCAN_GAIN && best.as_ref().is_none_or(|(most, _)| gain > *most) {
                    best = Some((gain, fitted));
                }
            }
            if let Some((_, fitted)) = best {
                self.keep(&near, fitted, spot.place_mm);
                count += 1;
            }
        }
        count
    }

    /// The best places of a scan, apart from each other.
    fn scan_starts(&mut self, n: usize) -> Vec<Spot> {
        let spot = self.members[n].spot;
        let px = self.setting.pixel_mm;
        self.lift(&[n]);
        let mut tried = Vec::new();
        for z in SCAN_DEPTH {
            for y in SCAN_ASIDE {
                for x in SCAN_ASIDE {
                    let [x0, y0, z0] = spot.place_mm;
                    let there = Spot { place_mm: [x0 + px * x, y0 + px * y, z0 + px * z], ..spot };
                    let image = self.setting.light_image(&there, self.window, self.buffers);
                    let level = self.setting.deviance(self.window, std::iter::once(&image), self.buffers);
                    tried.push((level, [x, y, z], there));
                }
            }
        }
        self.lay(&[n]);
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Vec<([f64; 3], Spot)> = Vec::new();
        for (_, step, spot) in tried {
            let is_beside = |other: &[f64; 3]| {
                (step[0] - other[0]).abs() < 4.0
                    && (step[1] - other[1]).abs() < 4.0
                    && (step[2] - other[2]).abs() < 25.0
            };
            if !best.iter().any(|(other, _)| is_beside(other)) {
                best.push((step, spot));
            }
            if best.len() == SCAN_BEST {
                break;
            }
        }
        best.into_iter().map(|(_, spot)| spot).collect()
    }
}
