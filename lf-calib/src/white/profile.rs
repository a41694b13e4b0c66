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

/// Places along a side of a pixel, from its centre.
fn samples() -> [f64; SAMPLES] {
    std::array::from_fn(|n| (n as f64 + 0.5) / SAMPLES as f64 - 0.5)
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

    #[inline(always)]
    fn distance(&self, x: f64, y: f64) -> f64 {
        match self.stop {
            Aperture::Circle => (x * x + y * y).sqrt(),
            Aperture::Square => x.abs().max(y.abs()),
        }
    }

    /// Fills `line` with the share of each unknown in a pixel at `offset_px` from the lenslet image's centre.
    fn fill(&self, offset_px: DVec2, line: &mut Vec<f64>) {
        line.clear();
        line.resize(self.knots + 1, 0.0);
        let (per_step, end) = (1.0 / self.step_px, self.knots as f64);
        let reach = end * self.step_px + std::f64::consts::FRAC_1_SQRT_2;
        for lenslet in &self.lenslets {
            let offset = offset_px - *lenslet;
            if self.distance(offset.x, offset.y) >= reach {
                continue;
            }
            // In steps of the knots. The profile is zero from the last knot on.
            let [x, y] = offset.to_array().map(|middle| samples().map(|sample| per_step * (middle + sample)));
            for y in y {
                let distances = x.map(|x| self.distance(x, y));
                for distance in distances.into_iter().filter(|distance| *distance < end) {
                    let knot = distance as usize;
                    let share = distance - knot as f64;
                    line[knot] += 1.0 - share;
                    line[knot + 1] += share;
                }
            }
        }
        line.iter_mut().for_each(|share| *share *= 1.0 / (SAMPLES * SAMPLES) as f64);
        line[self.knots] = 1.0;
    }

    /// Adds a pixel. `line` is scratch memory.
    pub fn add(&mut self, offset_px: DVec2, value: f64, line: &mut Vec<f64>) {
        self.fill(offset_px, line);
        for (a, share) in line.iter().enumerate().filter(|(_, share)| **share != 0.0) {
            self.right[a] += share * value;
            // The lower triangle is enough.
            let column = &mut self.normal.as_mut_slice()[a * line.len()..(a + 1) * line.len()];
            column[a..].iter_mut().zip(&line[a..]).for_each(|(sum, other)| *sum += share * other);
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
