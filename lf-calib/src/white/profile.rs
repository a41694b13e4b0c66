//! The round or square part of the mean cell: one brightness profile S(r) about every centre, seen through square
//! pixels. The distance r is along a line for a round stop, and the larger one of |x| and |y| for a square stop.
//!
//! A pixel at x sees the mean, over its square, of base + sum over lenslets of S(r(x - c)). If the pitch is near a
//! whole number of pixels, all lenslets are sampled at the same places, but the distances of their pixels from the
//! centre still differ: S is resolved much finer than a pixel, and the sampling does not move the centre.

use super::{basis::shortest, mean_cell::MeanCell};
use glam::{DMat2, DVec2};
use lf_core::camera::Aperture;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Reach of the profile in shortest lattice vectors: the corner of a square cell, beyond the pixels that are read.
const REACH: f64 = 0.71;
/// Smallest distance between knots, px. With a third of a pixel an unrotated lattice's pitch erred by 1.4e-5, now by
/// 2e-6.
const STEP_PX: f64 = 0.2;
/// Largest number of knots. More of them would follow the noise of a few large lenslets.
const MOST_KNOTS: f64 = 64.0;
/// Samples along each side of a pixel.
const SAMPLES: usize = 8;
/// Weight of the profile's curvature and height against its misfit. It only determines what no pixel does.
const ROUGHNESS: f64 = 1e-6;

/// Positions in a pixel relative to its centre.
fn samples(side: usize) -> impl Iterator<Item = DVec2> {
    let at = move |n: usize| (n as f64 + 0.5) / side as f64 - 0.5;
    (0..side * side).map(move |n| DVec2::new(at(n % side), at(n / side)))
}

/// Normal equations of the profile, summed over pixels. The last unknown is the base.
pub(crate) struct ProfileEquations {
    stop: Aperture,
    basis_px: DMat2,
    step_px: f64,
    knots: usize,
    lenslets: Vec<DVec2>,
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

impl ProfileEquations {
    pub fn new(stop: Aperture, basis_px: DMat2) -> Self {
        let reach = REACH * shortest(basis_px);
        let step_px = STEP_PX.max(reach / MOST_KNOTS);
        let knots = (reach / step_px) as usize;
        let lenslets = (-2..=2)
            .flat_map(|n| (-2..=2).map(move |m| basis_px * DVec2::new(m as f64, n as f64)))
            .filter(|place| place.abs().max_element() < 2.0 * reach + 1.0)
            .collect();
        let normal = DMatrix::zeros(knots + 1, knots + 1);
        Self { stop, basis_px, step_px, knots, lenslets, normal, right: DVector::zeros(knots + 1) }
    }

    /// The knot before an offset's distance, and the weight of the next one. None after the last knot, where the
    /// profile is zero.
    #[inline]
    fn knots_at(&self, offset_px: DVec2) -> Option<(usize, f64)> {
        let distance_px = match self.stop {
            Aperture::Circle => offset_px.length(),
            Aperture::Square => offset_px.abs().max_element(),
        };
        let t = distance_px / self.step_px;
        let knot = t as usize;
        (knot < self.knots).then_some((knot, t - knot as f64))
    }

    fn near(&self, offset_px: DVec2) -> Vec<DVec2> {
        let half_pixel = std::f64::consts::FRAC_1_SQRT_2;
        let reach = self.knots as f64 * self.step_px;
        let is_near = |place: &DVec2| match self.stop {
            Aperture::Circle => place.distance(offset_px) < reach + half_pixel,
            Aperture::Square => (*place - offset_px).abs().max_element() < reach + half_pixel,
        };
        self.lenslets.iter().copied().filter(is_near).collect()
    }

    /// Fills `line` with the share of each unknown in a pixel at `offset_px` from the lenslet image's centre.
    fn fill(&self, offset_px: DVec2, line: &mut Vec<f64>) {
        line.clear();
        line.resize(self.knots + 1, 0.0);
        line[self.knots] = 1.0;
        let weight = 1.0 / (SAMPLES * SAMPLES) as f64;
        let near = self.near(offset_px);
        for sample in samples(SAMPLES) {
            for lenslet in &near {
                let Some((knot, share)) = self.knots_at(offset_px + sample - *lenslet) else { continue };
                line[knot] += weight * (1.0 - share);
                if knot + 1 < self.knots {
                    line[knot + 1] += weight * share;
                }
            }
        }
    }

    /// Adds a pixel. `line` is scratch memory.
    pub fn add(&mut self, offset_px: DVec2, value: f64, line: &mut Vec<f64>) {
        self.fill(offset_px, line);
        let touched: Vec<usize> = (0..=self.knots).filter(|&knot| line[knot] != 0.0).collect();
        for &a in &touched {
            self.right[a] += line[a] * value;
            for &b in &touched {
                self.normal[(a, b)] += line[a] * line[b];
            }
        }
    }

    pub fn merge(&mut self, other: &Self) {
        self.normal += &other.normal;
        self.right += &other.right;
    }

    /// The cell as pixels see it, a table of `knots` along its sides, and the squares that it explains. None if
    /// undetermined.
    pub fn solve(mut self, knots: [usize; 2]) -> Option<(f64, Vec<f64>)> {
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
        let explained = profile.dot(&self.right);
        let seen = |line: &mut Vec<f64>, place: usize| {
            self.fill(self.basis_px * MeanCell::place(knots, place), line);
            line.iter().zip(profile.iter()).map(|(share, value)| share * value).sum()
        };
        let places = 0..knots[0] * knots[1];
        Some((explained, places.into_par_iter().map_init(Vec::new, seen).collect()))
    }
}
