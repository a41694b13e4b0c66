//! The mean lenslet image of a white image, and the image of a blurred stop that it is compared with.
//!
//! A white image is the same from lenslet to lenslet, so it is a Fourier series over the lattice. Each of its terms is
//! that of the stop's image (a disc, a square or the polygon of an iris), times those of the pixel, of diffraction, and
//! of a Gaussian: blurs multiply. The light inside the stop may rise or fall with the square of the distance from the
//! middle.

use super::{image_lattice::ImageLattice, stop_series::StopSeries};
use crate::fit::lenslet_images::LensletImages;
use crate::fit::{polynomial::Polynomial, polynomial::TiePoint};
use glam::{DMat2, DVec2};
use lf_core::camera::{Aperture, Blades, Camera};
use lf_core::halo::sinc;
use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, s};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Bins of a cell a side, for each px of the pitch, and at most.
const BINS_PER_PX: f64 = 8.0;
const MOST_BINS: usize = 160;
/// Highest frequency of the series, 1/px, and most terms along an axis on either side.
const HIGHEST: f64 = 2.5;
const MOST_TERMS: usize = 120;
/// Pixels that are averaged, about.
const PIXELS: usize = 3_000_000;
/// Degree of the smooth light over the frame, and its parts along each side.
const LIGHT_DEGREE: usize = 3;
const LIGHT_PARTS: usize = 8;
/// Limits of the variance, px^2.
const LIMITS_PX2: [f64; 2] = [-0.3, 25.0];

/// The image of a stop.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    /// Half its width, at the corners of blades.
    pub(super) half_px: f64,
    /// Variance of the Gaussian beyond diffraction.
    pub(super) variance_px2: f64,
    /// None for a disc or a square.
    pub(super) blades: Option<Blades>,
    /// Its middle, from the lenslet's: a polygon of an odd number of sides has no symmetry to read the lattice by.
    pub(super) aside_px: DVec2,
}

impl Edge {
    /// After a step of the logarithm of the half width, the variance, and the blades' turn, apothem and place.
    pub(super) fn moved(&self, step: &DVector<f64>) -> Self {
        let blades = |blades: Blades| Blades {
            turn_rad: blades.turn_rad + step[2].clamp(-0.1, 0.1),
            apothem: (blades.apothem + step[3].clamp(-0.05, 0.05)).clamp(Blades::straight(blades.count), 1.0),
            ..blades
        };
        Self {
            half_px: self.half_px * step[0].clamp(-0.1, 0.1).exp(),
            variance_px2: (self.variance_px2 + step[1].clamp(-0.3, 0.3)).clamp(LIMITS_PX2[0], LIMITS_PX2[1]),
            blades: self.blades.map(blades),
            aside_px: self.blades.map_or(DVec2::ZERO, |_| self.aside_px + DVec2::new(step[4], step[5])),
        }
    }
}

/// A frequency of the lattice, and what pixel, bin and diffraction leave of it.
struct Term {
    frequency: DVec2,
    transfer: f64,
}

/// The mean cell in bins of lattice coordinates.
pub(super) struct WhiteCell {
    aperture: Aperture,
    /// Terms for n from -count to count, fastest, and m from 0 to count: those of -m are the conjugates of those of m.
    terms: Vec<Term>,
    /// Cosine and sine of each n at the middle of each bin, n fastest.
    waves: Vec<DVec2>,
    count: usize,
    bins: usize,
    /// Mean light of each bin and the square root of its share of the pixels, u fastest.
    levels: Vec<f64>,
    weights: Vec<f64>,
    /// Mean place of a bin's pixels from its middle, bins. Pixels of a lattice in line with them do not fill all bins.
    aside: Vec<DVec2>,
    basis_px: DMat2,
    cell_px2: f64,
}

impl WhiteCell {
    pub(super) fn new(white: &Array2<f32>, camera: &Camera, lattice: &ImageLattice) -> Option<Self> {
        let perfect = Camera { centres: None, ..camera.clone() }.lattice();
        let [origin, along, across] = [(0, 0), (1, 0), (0, 1)].map(|(i, j)| perfect.centre_mm(i, j));
        let basis_mm = DMat2::from_cols(along - origin, across - origin);
        let images = LensletImages::new(camera);
        let basis_px = basis_mm * (1.0 / images.lenslet_mm_per_px());
        let pitch_px = basis_px.x_axis.length();
        let bins = ((BINS_PER_PX * pitch_px) as usize).clamp(8, MOST_BINS);
        let light = SmoothLight::new(white, pitch_px)?;
        let untouched_px = untouched_px(camera, lattice);
        let (middle, per_cell) = (0.5 * DVec2::new(white.ncols() as f64, white.nrows() as f64), basis_mm.inverse());

        // Average the pixels by their place in the cell.
        let lenslets = camera.lattice();
        let (mut sums, mut counts) = (vec![0.0; bins * bins], vec![0.0; bins * bins]);
        let mut aside = vec![DVec2::ZERO; bins * bins];
        let step = (white.len() / PIXELS).max(1) | 1;
        for (row, line) in white.rows().into_iter().enumerate().step_by(step) {
            for (column, count) in line.iter().enumerate() {
                let place = DVec2::new(column as f64, row as f64) + 0.5;
                if !count.is_finite() || place.distance(middle) > untouched_px {
                    continue;
                }
                let turns = per_cell * (lenslets.perfect(images.lenslet_mm(place)) - origin);
                let place_bins = (turns - turns.floor()) * bins as f64;
                let bin = place_bins.floor().min(DVec2::splat(bins as f64 - 1.0));
                let n = bin.y as usize * bins + bin.x as usize;
                aside[n] += place_bins - bin - 0.5;
                sums[n] += f64::from(*count) / light.at(place);
                counts[n] += 1.0;
            }
        }
        let all: f64 = counts.iter().sum();
        (all > 0.0).then(|| {
            let count = ((HIGHEST * pitch_px).ceil() as usize).min(MOST_TERMS);
            Self {
                aperture: camera.main_lens.aperture,
                terms: terms(camera, basis_px, count, bins),
                waves: waves(count, bins),
                count,
                bins,
                levels: sums.iter().zip(&counts).map(|(sum, count)| sum / f64::max(*count, 1.0)).collect(),
                aside: aside.iter().zip(&counts).map(|(sum, count)| *sum / f64::max(*count, 1.0)).collect(),
                weights: counts.iter().map(|count| (count / all * (bins * bins) as f64).sqrt()).collect(),
                basis_px,
                cell_px2: basis_px.determinant().abs(),
            }
        })
    }

    /// The middles of all bins, from the nearest lenslet image.
    pub(super) fn bins_px(&self) -> impl Iterator<Item = DVec2> {
        (0..self.levels.len()).map(|n| {
            let turns = DVec2::new((n % self.bins) as f64 + 0.5, (n / self.bins) as f64 + 0.5) / self.bins as f64;
            let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|corner| turns - DVec2::from(corner));
            let from = corners.map(|turns| self.basis_px * turns);
            from.into_iter().min_by(|a, b| a.length().total_cmp(&b.length())).expect("four corners")
        })
    }

    /// Takes light that diffracts as the camera says.
    pub(super) fn set_light(&mut self, camera: &Camera) {
        self.terms = terms(camera, self.basis_px, self.count, self.bins);
    }

    /// Residuals of the best light and ground for an edge, and that light in the middle and at the rim. None without
    /// light.
    pub(super) fn residuals(&self, edge: &Edge) -> Option<(DVector<f64>, [f64; 2])> {
        let stop = StopSeries::new(self.aperture, edge.half_px, edge.blades);
        let blurred = |term: &Term| {
            let soft = (-2.0 * PI * PI * edge.variance_px2 * term.frequency.length_squared()).exp();
            let aside = DVec2::from_angle(-2.0 * PI * term.frequency.dot(edge.aside_px));
            stop.at(term.frequency).map(|share| aside.rotate(share) * soft * term.transfer / self.cell_px2)
        };
        let series: Vec<[DVec2; 2]> = self.terms.par_iter().map(blurred).collect();
        let columns = [0, 1].map(|n| self.levels(series.iter().map(|both| both[n])));
        let lines = DMatrix::from_fn(self.levels.len(), 3, |bin, n| {
            self.weights[bin] * if n < 2 { columns[n][bin] } else { 1.0 }
        });
        let levels = DVector::from_fn(self.levels.len(), |bin, _| self.weights[bin] * self.levels[bin]);
        let normal = lines.tr_mul(&lines);
        let ridge = DMatrix::identity(3, 3) * (1e-10 * normal.trace());
        let solution = (normal + ridge).cholesky()?.solve(&lines.tr_mul(&levels));
        let light = [solution[0] + solution[1], solution[0]];
        (light[0] + light[1] > 0.0).then(|| (levels - lines * solution, light))
    }

    /// The series with these coefficients, complex numbers, at the mean place of every bin.
    fn levels(&self, coefficients: impl Iterator<Item = DVec2>) -> Vec<f64> {
        let (bins, middles) = (self.bins, self.sum(coefficients));
        let at = |u: usize, v: usize| middles[v % bins * bins + u % bins];
        let level = |(n, aside): (usize, &DVec2)| {
            let (u, v) = (n % bins, n / bins);
            let slope = DVec2::new(at(u + 1, v) - at(u + bins - 1, v), at(u, v + 1) - at(u, v + bins - 1));
            middles[n] + 0.5 * slope.dot(*aside)
        };
        self.aside.iter().enumerate().map(level).collect()
    }

    /// The series at the middle of every bin.
    fn sum(&self, coefficients: impl Iterator<Item = DVec2>) -> Vec<f64> {
        let (side, half, bins) = (2 * self.count + 1, self.count + 1, self.bins);
        let waves = |bin: usize| &self.waves[bin * side..(bin + 1) * side];
        // Sum along u for every m, then along v.
        let coefficients: Vec<DVec2> = coefficients.collect();
        let mut along = vec![DVec2::ZERO; bins * half];
        for (m, line) in coefficients.chunks(side).enumerate() {
            for bin in 0..bins {
                let pairs = line.iter().zip(waves(bin));
                along[bin * half + m] = pairs.map(|(c, wave)| wave.rotate(*c)).sum();
            }
        }
        let value = |k: usize| {
            let (u, v) = (k % bins, k / bins);
            let pairs = along[u * half..(u + 1) * half].iter().zip(&waves(v)[self.count..]);
            pairs.map(|(sum, wave)| sum.x * wave.x - sum.y * wave.y).sum()
        };
        (0..bins * bins).map(value).collect()
    }
}

/// See [`WhiteCell::waves`].
fn waves(count: usize, bins: usize) -> Vec<DVec2> {
    let side = 2 * count + 1;
    let angle = |n: usize, bin: usize| 2.0 * PI * (n as f64 - count as f64) * (bin as f64 + 0.5) / bins as f64;
    (0..bins * side).map(|k| angle(k % side, k / side)).map(DVec2::from_angle).collect()
}

/// The frequencies of a lattice with these vectors, px. Those of m above 0 count twice.
fn terms(camera: &Camera, basis_px: DMat2, count: usize, bins: usize) -> Vec<Term> {
    let inverse = basis_px.inverse().transpose();
    let axis = basis_px.x_axis.normalize();
    let diffraction = camera.diffraction();
    let side = 2 * count + 1;
    let term = |k: usize| {
        let order = DVec2::new((k % side) as f64 - count as f64, (k / side) as f64);
        let times = if order.y > 0.0 { 2.0 } else { 1.0 };
        let frequency = inverse * order;
        let pixel = sinc(frequency.x) * sinc(frequency.y);
        let bin = sinc(order.x / bins as f64) * sinc(order.y / bins as f64);
        let along = DVec2::new(frequency.dot(axis), axis.perp_dot(frequency));
        let diffracted = diffraction.map_or(1.0, |pattern| pattern.transfer(along));
        Term { frequency, transfer: times * pixel * bin * diffracted }
    };
    (0..side * (count + 1)).map(term).collect()
}

/// The distance from the frame's middle, px, within which a second stop leaves lenslet images whole.
fn untouched_px(camera: &Camera, lattice: &ImageLattice) -> f64 {
    let Some(second) = &lattice.second_stop else { return f64::INFINITY };
    let width_px = camera.stop_image_px();
    let corner = if camera.main_lens.aperture == Aperture::Square { std::f64::consts::SQRT_2 } else { 1.0 };
    let spare_px = 0.5 * (second.diameter_px - corner * width_px) - DVec2::from(second.aside_px).length();
    spare_px / second.slope.abs().max(1e-9)
}

/// The light over the frame without the lenslets, over its mean.
struct SmoothLight {
    light: Option<Polynomial>,
    mean: f64,
}

impl SmoothLight {
    /// A polynomial through the means of parts that hold whole lenslets, nearly. None without light.
    fn new(white: &Array2<f32>, pitch_px: f64) -> Option<Self> {
        let side = |length: usize| {
            let lenslets = (length as f64 / LIGHT_PARTS as f64 / pitch_px).floor().max(2.0);
            ((lenslets * pitch_px).round() as usize).min(length)
        };
        let (height, width) = white.dim();
        let [down, across] = [height, width].map(side);
        let mut ties: Vec<TiePoint> = Vec::new();
        for top in (0..=height - down).step_by(down) {
            for left in (0..=width - across).step_by(across) {
                let part = white.slice(s![top..top + down, left..left + across]);
                let mean = part.iter().map(|count| f64::from(*count)).sum::<f64>() / part.len() as f64;
                let middle = DVec2::new(left as f64, top as f64) + 0.5 * DVec2::new(across as f64, down as f64);
                ties.push((middle, DVec2::new(mean, 0.0)));
            }
        }
        let mean = ties.iter().map(|tie| tie.1.x).sum::<f64>() / ties.len() as f64;
        let is_enough = ties.len() >= 4 * (LIGHT_DEGREE + 1) * (LIGHT_DEGREE + 2) / 2;
        let light = is_enough.then(|| Polynomial::through(&ties, LIGHT_DEGREE)).flatten();
        (mean > 0.0).then_some(Self { light, mean })
    }

    fn at(&self, place: DVec2) -> f64 {
        self.light.as_ref().map_or(self.mean, |light| light.at(place).x.max(0.05 * self.mean))
    }
}
