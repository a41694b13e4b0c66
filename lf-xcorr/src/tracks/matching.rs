//! Which particle of the first frame is which of the second.
//!
//! Equation: a pair stands for one particle with the likelihood `N(r; A + B + G) / density`, times the ratio of the
//! probability of its two lights under one particle and under two. r is the displacement less the guess at the
//! midpoint, A and B are the covariances of both places, G is the guess's. N is the normal density, so a candidate that
//! is uncertain has less of it than one that is sure and near. Pairs must be each other's best, and more likely than
//! everything else that either of them could be.

use super::{buckets::Buckets, guess::Guess, points::Point};
use glam::{DMat3, DVec3};
use lf_core::statistics::{median, robust};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Constant: standard deviations that a gate reaches along each axis, and its square for a Mahalanobis distance.
const GATE: f64 = 5.0;
/// Constant: share of the particles that are expected in one frame only.
const ALONE: f64 = 0.05;
/// Constant: a pair must be at least this likely.
const LIKELY: f64 = 0.5;

/// Two particles that are one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Match {
    pub first: usize,
    pub second: usize,
    pub middle_mm: DVec3,
    pub shift_mm: DVec3,
    /// Covariance of the displacement, mm².
    pub covariance_mm2: DMat3,
    /// Probability that the pair is right.
    pub chance: f64,
    /// Second light over the first, as a natural logarithm.
    pub log_gain: f64,
}

/// How the light of one particle may differ between the frames.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Light {
    /// Natural logarithm of the second frame's light over the first's.
    log_gain: f64,
    /// Standard deviation of that logarithm from particle to particle.
    log_spread: f64,
    /// Variance of the logarithm's difference between particles that have nothing to do with each other.
    unrelated: f64,
}

impl Light {
    /// Constant: before pairs are known, the light of a particle may change by half.
    const UNKNOWN: f64 = 0.5;
    /// Constant: least spread; lasers and sheets are no steadier.
    const LEAST: f64 = 0.05;

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

    /// The same with gain and spread of known pairs.
    pub fn seen(self, pairs: &[Match]) -> Self {
        let gains: Vec<f64> = pairs.iter().map(|pair| pair.log_gain).filter(|gain| gain.is_finite()).collect();
        match gains.is_empty() {
            true => self,
            false => {
                let (log_gain, spread) = robust(&gains);
                Self { log_gain, log_spread: spread.max(Self::LEAST), ..self }
            }
        }
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
    pub frames: [&'a [Point]; 2],
    /// A pair is judged by the guess that suits it best.
    pub guesses: &'a [&'a Guess],
    pub light: Light,
    /// Particles in a cubic millimetre of the second frame.
    pub density: f64,
}

impl Matcher<'_> {
    /// The pairs, by rising number of the first particle.
    pub fn pairs(&self) -> Vec<Match> {
        let all = self.candidates();
        let likelihood = |(pair, log): &(Match, f64)| (pair.first, pair.second, log.exp());
        let mut sums = self.frames.map(|points| vec![ALONE; points.len()]);
        let mut best = self.frames.map(|points| vec![(0.0, usize::MAX); points.len()]);
        for (n, (first, second, likelihood)) in all.iter().map(likelihood).enumerate() {
            for (side, point) in [first, second].into_iter().enumerate() {
                sums[side][point] += likelihood;
                if likelihood > best[side][point].0 {
                    best[side][point] = (likelihood, n);
                }
            }
        }
        let chosen = |(n, (pair, log)): (usize, &(Match, f64))| {
            let is_best = best[0][pair.first].1 == n && best[1][pair.second].1 == n;
            let chance = log.exp() / sums[0][pair.first].max(sums[1][pair.second]);
            (is_best && chance > LIKELY).then_some(Match { chance, ..*pair })
        };
        all.iter().enumerate().filter_map(chosen).collect()
    }

    /// All pairs inside the gates, with the logarithm of their likelihood.
    fn candidates(&self) -> Vec<(Match, f64)> {
        let mut all = Vec::new();
        for guess in self.guesses {
            all.extend(self.near(0, guess));
            all.extend(self.near(1, guess).into_iter().map(|[second, first]| [first, second]));
        }
        all.par_sort_unstable();
        all.dedup();
        all.into_par_iter().filter_map(|[first, second]| self.candidate(first as usize, second as usize)).collect()
    }

    /// For each particle of one frame, those of the other inside its box. A sure particle has a small box and an
    /// uncertain one a large box, so either finds the other if both boxes are asked.
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

    fn candidate(&self, n: usize, m: usize) -> Option<(Match, f64)> {
        let (first, second) = (&self.frames[0][n], &self.frames[1][m]);
        let (shift, middle) = (second.place_mm - first.place_mm, 0.5 * (first.place_mm + second.place_mm));
        let covariance = first.covariance_mm2 + second.covariance_mm2;
        let density =
            |guess: &&Guess| log_density(shift - guess.shift_mm(middle), covariance, guess.variance_mm2(middle));
        let log_density = self.guesses.iter().filter_map(density).max_by(f64::total_cmp)?;
        let pair = Match {
            first: n,
            second: m,
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
    // A covariance that rounding has made singular gives no distance.
    let log_density = -0.5 * (distance2 + total.determinant().ln() + 3.0 * TAU.ln());
    (distance2 < GATE * GATE && log_density.is_finite()).then_some(log_density)
}
