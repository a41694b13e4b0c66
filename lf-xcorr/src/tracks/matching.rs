//! Which particle of the first frame is which of the second.
//!
//! Equation: the likelihood that a pair is one particle is `N(r; A + B + G) / density`, times the ratio of the
//! probabilities of its two lights under one particle and under two. r is the displacement less the guess at the
//! midpoint, A and B are the covariances of both places, G is the guess's. N is the normal density, so an uncertain
//! candidate counts less than a certain one that is near. The particles of a pair must be each other's best, and the
//! pair must be more likely than all their other possibilities together.

use super::{buckets::Buckets, guess::Guess, points::Point};
use glam::{DMat3, DVec3};
use lf_core::statistics::{median, robust};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Constant: size of a gate in standard deviations, along each axis and as a Mahalanobis distance.
const GATE: f64 = 5.0;
/// Constant: expected share of the particles that are in one frame only.
const ALONE: f64 = 0.05;
/// Constant: a pair must be at least this likely.
const LIKELY: f64 = 0.5;

/// A particle that was found in both frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Number of the pair of tables, from 0.
    pub tables: usize,
    /// Line of the particle in the first and in the second table, from 0.
    pub particles: [usize; 2],
    /// Half way between both places, mm.
    pub middle_mm: DVec3,
    /// From the first to the second place, mm.
    pub shift_mm: DVec3,
    /// Covariance of the displacement, mm².
    pub covariance_mm2: DMat3,
    /// Probability that the pair is right, by the motion around it.
    pub chance: f64,
    /// Second light over the first, as a natural logarithm.
    pub(crate) log_gain: f64,
}

/// How the light of one particle may differ between the frames.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightModel {
    /// Natural logarithm of the second frame's light over the first's.
    log_gain: f64,
    /// Standard deviation of that logarithm from particle to particle.
    log_spread: f64,
    /// Variance of the logarithm's difference between two unrelated particles.
    unrelated: f64,
}

impl LightModel {
    /// Constant: before pairs are known, the light of a particle may change by half.
    const UNKNOWN: f64 = 0.5;
    /// Constant: minimum spread; lasers and light sheets are no steadier.
    const MINIMUM: f64 = 0.05;

    pub fn new(frames: [&[Point]; 2]) -> Self {
        let lights = frames.map(|points| {
            let known = points.iter().map(|point| point.log_light).filter(|light| !light.is_nan());
            robust(&known.collect::<Vec<f64>>())
        });
        let [(first, first_spread), (second, second_spread)] = lights;
        let is_known = first.is_finite() && second.is_finite();
        let unrelated = first_spread * first_spread + second_spread * second_spread;
        Self {
            log_gain: if is_known { second - first } else { 0.0 },
            log_spread: Self::UNKNOWN,
            unrelated: if is_known { unrelated } else { 0.0 },
        }
    }

    /// Like `self`, with gain and spread of known pairs.
    pub fn seen(self, pairs: &[Pair]) -> Self {
        let gains: Vec<f64> = pairs.iter().map(|pair| pair.log_gain).filter(|gain| gain.is_finite()).collect();
        if gains.is_empty() {
            return self;
        }
        let (log_gain, spread) = robust(&gains);
        Self { log_gain, log_spread: spread.max(Self::MINIMUM), ..self }
    }

    /// Logarithm of the probability of a change of light in one particle over that in two.
    fn evidence(&self, first: &Point, second: &Point) -> f64 {
        let change = second.log_light - first.log_light - self.log_gain;
        let same = self.log_spread * self.log_spread + first.log_variance + second.log_variance;
        let other = self.unrelated.max(same);
        let evidence = -0.5 * (change * change * (same.recip() - other.recip()) + (same / other).ln());
        if evidence.is_nan() { 0.0 } else { evidence }
    }
}

/// Two frames and what is known of the motion between them.
pub(crate) struct Matcher<'a> {
    /// Number of the pair of tables.
    pub tables: usize,
    pub frames: [&'a [Point]; 2],
    /// A pair is judged by the guess that suits it best.
    pub guesses: &'a [&'a Guess],
    pub light: LightModel,
    /// Particles in a cubic millimetre of the second frame.
    pub density: f64,
}

impl Matcher<'_> {
    /// The pairs, by rising number of the first particle.
    pub fn pairs(&self) -> Vec<Pair> {
        let all = self.candidates();
        let likelihood = |(pair, log): &(Pair, f64)| (pair.particles, log.exp());
        let mut sums = self.frames.map(|points| vec![ALONE; points.len()]);
        let mut best = self.frames.map(|points| vec![(0.0, usize::MAX); points.len()]);
        for (n, (particles, likelihood)) in all.iter().map(likelihood).enumerate() {
            for (side, point) in particles.into_iter().enumerate() {
                sums[side][point] += likelihood;
                if likelihood > best[side][point].0 {
                    best[side][point] = (likelihood, n);
                }
            }
        }
        let chosen = |(n, (pair, log)): (usize, &(Pair, f64))| {
            let [first, second] = pair.particles;
            let is_best = best[0][first].1 == n && best[1][second].1 == n;
            let chance = log.exp() / sums[0][first].max(sums[1][second]);
            (is_best && chance > LIKELY).then_some(Pair { chance, ..*pair })
        };
        all.iter().enumerate().filter_map(chosen).collect()
    }

    /// All pairs inside the gates, with the logarithm of their likelihood.
    fn candidates(&self) -> Vec<(Pair, f64)> {
        let mut all = Vec::new();
        for guess in self.guesses {
            all.extend(self.near(0, guess));
            all.extend(self.near(1, guess).into_iter().map(|[second, first]| [first, second]));
        }
        all.par_sort_unstable();
        all.dedup();
        all.into_par_iter().filter_map(|[first, second]| self.candidate(first as usize, second as usize)).collect()
    }

    /// For each particle of one frame, those of the other inside its box. A certain particle has a small box and an
    /// uncertain one a large box, so a pair is found if both sides are searched.
    fn near(&self, side: usize, guess: &Guess) -> Vec<[u32; 2]> {
        let [own, other] = [self.frames[side], self.frames[1 - side]];
        let usual = DVec3::from_array([0, 1, 2].map(|axis| {
            median(&mut other.iter().map(|point| point.covariance_mm2.col(axis)[axis]).collect::<Vec<f64>>())
        }));
        let buckets = Buckets::new(other.iter().map(|point| point.place_mm).collect());
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let near_point = |(n, point): (usize, &Point)| -> Vec<[u32; 2]> {
            let middle = guess.middle_mm(point.place_mm, sign);
            let variance = point.covariance_mm2.diagonal() + guess.variance_mm2(middle) + usual;
            let found = buckets.near(2.0 * middle - point.place_mm, GATE * variance.map(f64::sqrt));
            found.map(|other| [n as u32, other as u32]).collect()
        };
        own.par_iter().enumerate().flat_map_iter(near_point).collect()
    }

    fn candidate(&self, n: usize, m: usize) -> Option<(Pair, f64)> {
        let (first, second) = (&self.frames[0][n], &self.frames[1][m]);
        let (shift, middle) = (second.place_mm - first.place_mm, 0.5 * (first.place_mm + second.place_mm));
        let covariance = first.covariance_mm2 + second.covariance_mm2;
        let density =
            |guess: &&Guess| log_density(shift - guess.shift_mm(middle), covariance, guess.variance_mm2(middle));
        let log_density = self.guesses.iter().filter_map(density).max_by(f64::total_cmp)?;
        let pair = Pair {
            tables: self.tables,
            particles: [n, m],
            middle_mm: middle,
            shift_mm: shift,
            covariance_mm2: covariance,
            chance: 0.0,
            log_gain: second.log_light - first.log_light,
        };
        Some((pair, log_density - self.density.ln() + self.light.evidence(first, second)))
    }
}

/// Logarithm of the normal density of a displacement less its guess; None outside the gate.
fn log_density(rest_mm: DVec3, covariance_mm2: DMat3, guess_mm2: DVec3) -> Option<f64> {
    let total = covariance_mm2 + DMat3::from_diagonal(guess_mm2);
    let distance2 = rest_mm.dot(total.inverse() * rest_mm);
    // Rounding can make a covariance singular; then there is no distance.
    let log_density = -0.5 * (distance2 + total.determinant().ln() + 3.0 * TAU.ln());
    (distance2 < GATE * GATE && log_density.is_finite()).then_some(log_density)
}
