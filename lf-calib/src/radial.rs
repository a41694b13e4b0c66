//! The round part of the mean cell: one brightness profile S(r) about every centre, seen through square pixels.
//!
//! A pixel at x sees the mean over its square of base + sum over lenslets S(|x - c|). Though all lenslets of a lattice
//! whose pitch is near a whole number of pixels are sampled alike, the distances of their pixels from the centre differ
//! all the same, so that S is known far finer than a pixel; that keeps the sampling out of the centre. Discs that
//! overlap add up.

use crate::cell::Cell;
use crate::period::shortest;
use crate::rim::radius_px;
use glam::{DMat2, DVec2};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Reach of the profile in shortest lattice vectors: the corner of a square cell, past the pixels that are read.
const REACH: f64 = 0.71;
/// Distance between the profile's knots, px, and the most of them. At a third of a pixel the pitch of an unrotated lattice
/// came out 1.4e-5 wrong, at a fifth 2e-6; more than 64 knots in a few large lenslets follow their noise.
const STEP_PX: f64 = 0.2;
const MOST_KNOTS: f64 = 64.0;
/// Samples along a pixel's side while the profile is fitted, and while it is tabulated.
const FIT_SAMPLES: usize = 8;
const TABLE_SAMPLES: usize = 8;
/// Weight of the profile's bends and of its height against its misfit: decides only what no pixel decides.
const ROUGHNESS: f64 = 1e-6;

/// Places in a pixel relative to its centre.
fn samples(side: usize) -> impl Iterator<Item = DVec2> {
    let at = move |n: usize| (n as f64 + 0.5) / side as f64 - 0.5;
    (0..side * side).map(move |n| DVec2::new(at(n % side), at(n / side)))
}

/// Normal equations of the profile, summed over pixels. The last unknown is the base.
#[derive(Debug, Clone)]
pub(crate) struct RadialFold {
    basis_px: DMat2,
    step_px: f64,
    knots: usize,
    lenslets: Vec<DVec2>,
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

impl RadialFold {
    /// Empty equations for a lattice.
    pub fn new(basis_px: DMat2) -> Self {
        let reach = REACH * shortest(basis_px);
        let step_px = STEP_PX.max(reach / MOST_KNOTS);
        let knots = (reach / step_px) as usize;
        let lenslets = (-2..=2)
            .flat_map(|n| (-2..=2).map(move |m| basis_px * DVec2::new(m as f64, n as f64)))
            .filter(|place| place.length() < 2.0 * reach + 1.0)
            .collect();
        let normal = DMatrix::zeros(knots + 1, knots + 1);
        Self { basis_px, step_px, knots, lenslets, normal, right: DVector::zeros(knots + 1) }
    }

    /// The two knots around a distance and the second one's share; the last knot is followed by zero.
    #[inline]
    fn knots_at(&self, distance_px: f64) -> Option<(usize, f64)> {
        let t = distance_px / self.step_px;
        let knot = t as usize;
        (knot < self.knots).then_some((knot, t - knot as f64))
    }

    /// The lenslets whose profile reaches a pixel.
    fn near(&self, offset_px: DVec2) -> Vec<DVec2> {
        let reach = self.knots as f64 * self.step_px + std::f64::consts::FRAC_1_SQRT_2;
        self.lenslets.iter().filter(|place| place.distance(offset_px) < reach).copied().collect()
    }

    /// Adds a pixel whose centre is at `offset_px` from a lenslet image's; `line` is scratch.
    pub fn add(&mut self, offset_px: DVec2, value: f64, line: &mut Vec<f64>) {
        line.clear();
        line.resize(self.knots + 1, 0.0);
        line[self.knots] = 1.0;
        let weight = 1.0 / (FIT_SAMPLES * FIT_SAMPLES) as f64;
        let near = self.near(offset_px);
        for sample in samples(FIT_SAMPLES) {
            for lenslet in &near {
                let Some((knot, share)) = self.knots_at((offset_px + sample).distance(*lenslet)) else { continue };
                line[knot] += weight * (1.0 - share);
                if knot + 1 < self.knots {
                    line[knot + 1] += weight * share;
                }
            }
        }
        let touched: Vec<usize> = (0..=self.knots).filter(|&knot| line[knot] != 0.0).collect();
        for &a in &touched {
            self.right[a] += line[a] * value;
            for &b in &touched {
                self.normal[(a, b)] += line[a] * line[b];
            }
        }
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &Self) {
        self.normal += &other.normal;
        self.right += &other.right;
    }

    /// The cell as pixels see it, at `knots` places along its sides, and the profile's radius where it has one; none if
    /// the pixels say nothing.
    pub fn solve(mut self, knots: [usize; 2]) -> Option<(Vec<f64>, Option<f64>)> {
        let weight = ROUGHNESS * self.normal.trace() / (self.knots + 1) as f64;
        for knot in 0..self.knots {
            self.normal[(knot, knot)] += weight;
            if knot == 0 || knot + 1 == self.knots {
                continue;
            }
            let bend = [(knot - 1, 1.0), (knot, -2.0), (knot + 1, 1.0)];
            for (a, x) in bend {
                for (b, y) in bend {
                    self.normal[(a, b)] += weight * x * y;
                }
            }
        }
        let profile = self.normal.clone().cholesky()?.solve(&self.right);
        let seen = |offset: DVec2| {
            let mut sum = 0.0;
            let near = self.near(offset);
            for sample in samples(TABLE_SAMPLES) {
                for lenslet in &near {
                    let Some((knot, share)) = self.knots_at((offset + sample).distance(*lenslet)) else { continue };
                    let next = if knot + 1 < self.knots { profile[knot + 1] } else { 0.0 };
                    sum += profile[knot] + share * (next - profile[knot]);
                }
            }
            profile[self.knots] + sum / (TABLE_SAMPLES * TABLE_SAMPLES) as f64
        };
        let places = 0..knots[0] * knots[1];
        let table = places.into_par_iter().map(|n| seen(self.basis_px * Cell::place(knots, n))).collect();
        Some((table, radius_px(&profile.as_slice()[..self.knots], self.step_px)))
    }
}
