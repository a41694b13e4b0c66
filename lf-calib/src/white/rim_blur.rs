//! The blur on the sensor, by how soft the rims of the lenslet images are.
//!
//! A white image is the same from lenslet to lenslet, so it is a Fourier series over the lattice. Each of its terms is
//! that of the stop's image (a disc or a square), times those of the pixel, of diffraction, and of a Gaussian: blurs
//! multiply. The light inside the stop may rise or fall with the square of the distance from the middle. Width and
//! Gaussian come by Levenberg-Marquardt from the mean of many cells, light and ground linearly.

use super::image_lattice::ImageLattice;
use crate::fit::lenslet_images::LensletImages;
use crate::fit::{polynomial::Polynomial, polynomial::TiePoint, search::Search};
use glam::{DMat2, DVec2};
use lf_core::camera::{Aperture, Blur, Camera, GREEN_NM};
use lf_core::halo::sinc;
use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, s};
use std::f64::consts::PI;

/// The Gaussian on the sensor, px, and the light that diffracts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RimBlur {
    /// Standard deviation, beyond diffraction at the lenslets if there is a wavelength; of all blur otherwise.
    pub sigma_px: f64,
    /// Standard uncertainty.
    pub uncertainty_px: f64,
    /// The camera's wavelength; green light where the camera names none and the rims show that it diffracts.
    pub wavelength_nm: Option<f64>,
}

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
/// Largest uncertainty of a blur that is believed, px, and largest misfit over the light. A blur below SEEN_PX may be
/// as uncertain as one of SEEN_PX with the same uncertainty of its square.
const MOST_UNCERTAIN_PX: f64 = 0.08;
const SEEN_PX: f64 = 0.2;
const MOST_MISFIT: f64 = 0.15;
/// Uncertainty of the model itself, px^2: the largest error of the square of the blur in images without noise.
const MODEL_PX2: f64 = 0.004;
/// Uncertainty that light which the model does not follow adds, px^2 for a misfit of all the light.
const UNFOLLOWED_PX2: f64 = 0.5;
/// Variance at the start, and its limits, px^2.
const START_PX2: f64 = 0.2;
const LIMITS_PX2: [f64; 2] = [-0.3, 25.0];

/// The blur of a white image whose camera is known, with the stop of the image. None if its rims do not show it.
pub fn rim_blur(white: &Array2<f32>, camera: &Camera, lattice: &ImageLattice) -> Option<RimBlur> {
    let mut cell = MeanCell::new(white, camera, lattice)?;
    let half_px = 0.5 * camera.demagnification() * camera.aperture_mm() / camera.sensor.pixel_pitch_mm;
    let blur = camera.blur.unwrap_or_default();
    let named = cell.soft_edge(half_px, blur.wavelength_nm)?;
    if blur.wavelength_nm.is_some() {
        return Some(named.blur);
    }
    let green = Blur { wavelength_nm: Some(GREEN_NM), ..blur };
    cell.terms = terms(&Camera { blur: Some(green), ..camera.clone() }, cell.basis_px, cell.count, cell.bins);
    let diffracted = cell.soft_edge(half_px, green.wavelength_nm).filter(|edge| edge.squares < named.squares);
    Some(diffracted.unwrap_or(named).blur)
}

/// A blur that fits the rims, and the sum of the squared residuals.
struct SoftEdge {
    blur: RimBlur,
    squares: f64,
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    half_px: f64,
    variance_px2: f64,
}

/// A frequency of the lattice, and what pixel, bin and diffraction leave of it.
struct Term {
    frequency: DVec2,
    transfer: f64,
}

/// The mean cell in bins of lattice coordinates.
struct MeanCell {
    aperture: Aperture,
    /// Terms for n from -count to count, fastest, and m from 0 to count: those of -m are the same as those of m.
    terms: Vec<Term>,
    /// Cosine and sine of each n at the middle of each bin, n fastest.
    waves: Vec<[f64; 2]>,
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

impl MeanCell {
    fn new(white: &Array2<f32>, camera: &Camera, lattice: &ImageLattice) -> Option<Self> {
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

    /// The blur with which the rims fit best, from the width of half a stop's image on; the terms are those of light
    /// of this wavelength. None if the rims do not show it.
    fn soft_edge(&self, half_px: f64, wavelength_nm: Option<f64>) -> Option<SoftEdge> {
        let search = Search {
            slope_steps: &[1e-4, 1e-3],
            damping: 1e-3,
            factors: [0.2, 10.0],
            least_square: 0.0,
            least_gain: 1e-8,
        };
        let residuals = |edge: &Edge| Some(self.residuals(*edge)?.0);
        let moved = |edge: &Edge, step: &DVector<f64>| Edge {
            half_px: edge.half_px * step[0].clamp(-0.1, 0.1).exp(),
            variance_px2: (edge.variance_px2 + step[1].clamp(-0.3, 0.3)).clamp(LIMITS_PX2[0], LIMITS_PX2[1]),
        };
        let edge = search.run(Edge { half_px, variance_px2: START_PX2 }, residuals, moved)?;
        let (here, light) = self.residuals(edge)?;
        let slopes = search.slopes(&edge, &here, residuals, moved)?;
        let inverse = slopes.tr_mul(&slopes).try_inverse()?;
        let squares = here.norm_squared();
        let scatter = squares / here.len().saturating_sub(5).max(1) as f64;
        let misfit = here.norm() / (light * (here.len() as f64).sqrt());
        let uncertainty_px2 = (inverse[(1, 1)] * scatter).sqrt().hypot(MODEL_PX2).hypot(UNFOLLOWED_PX2 * misfit);
        // The root of v + u is u / (2 sigma) above sigma, and the root of u where v is 0.
        let uncertainty_px = |px2: f64| (px2 + uncertainty_px2).sqrt() - px2.sqrt();
        let is_clear = uncertainty_px(edge.variance_px2.max(SEEN_PX * SEEN_PX)) < MOST_UNCERTAIN_PX
            && edge.variance_px2 > -3.0 * uncertainty_px2
            && misfit < MOST_MISFIT
            && edge.variance_px2 < half_px * half_px;
        let px2 = edge.variance_px2.max(0.0);
        let blur = RimBlur { sigma_px: px2.sqrt(), uncertainty_px: uncertainty_px(px2), wavelength_nm };
        is_clear.then_some(SoftEdge { blur, squares })
    }

    /// Residuals of the best light and ground for an edge, and that light. None without light.
    fn residuals(&self, edge: Edge) -> Option<(DVector<f64>, f64)> {
        let stop = StopSeries { aperture: self.aperture, half_px: edge.half_px };
        let blurred = |term: &Term| {
            let soft = (-2.0 * PI * PI * edge.variance_px2 * term.frequency.length_squared()).exp();
            stop.at(term.frequency).map(|share| share * soft * term.transfer / self.cell_px2)
        };
        let series: Vec<[f64; 2]> = self.terms.iter().map(blurred).collect();
        let columns = [0, 1].map(|n| self.levels(series.iter().map(|both| both[n])));
        let lines = DMatrix::from_fn(self.levels.len(), 3, |bin, n| {
            self.weights[bin] * if n < 2 { columns[n][bin] } else { 1.0 }
        });
        let levels = DVector::from_fn(self.levels.len(), |bin, _| self.weights[bin] * self.levels[bin]);
        let normal = lines.tr_mul(&lines);
        let ridge = DMatrix::identity(3, 3) * (1e-10 * normal.trace());
        let solution = (normal + ridge).cholesky()?.solve(&lines.tr_mul(&levels));
        let light = solution[0] + 0.5 * solution[1];
        (light > 0.0).then(|| (levels - lines * solution, light))
    }

    /// The series with these real, even coefficients, at the mean place of every bin.
    fn levels(&self, coefficients: impl Iterator<Item = f64>) -> Vec<f64> {
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
    fn sum(&self, coefficients: impl Iterator<Item = f64>) -> Vec<f64> {
        let (side, half, bins) = (2 * self.count + 1, self.count + 1, self.bins);
        let waves = |bin: usize| &self.waves[bin * side..(bin + 1) * side];
        // Sum along u for every m, then along v.
        let coefficients: Vec<f64> = coefficients.collect();
        let mut along = vec![[0.0; 2]; bins * half];
        for (m, line) in coefficients.chunks(side).enumerate() {
            for bin in 0..bins {
                let pairs = line.iter().zip(waves(bin));
                along[bin * half + m] = pairs.fold([0.0; 2], |[a, b], (c, [cos, sin])| [a + c * cos, b + c * sin]);
            }
        }
        let value = |k: usize| {
            let (u, v) = (k % bins, k / bins);
            let pairs = along[u * half..(u + 1) * half].iter().zip(&waves(v)[self.count..]);
            pairs.map(|([a, b], [cos, sin])| a * cos - b * sin).sum()
        };
        (0..bins * bins).map(value).collect()
    }
}

/// See [`MeanCell::waves`].
fn waves(count: usize, bins: usize) -> Vec<[f64; 2]> {
    let side = 2 * count + 1;
    let angle = |n: usize, bin: usize| 2.0 * PI * (n as f64 - count as f64) * (bin as f64 + 0.5) / bins as f64;
    (0..bins * side).map(|k| angle(k % side, k / side)).map(|angle| [angle.cos(), angle.sin()]).collect()
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
    let width_px = camera.demagnification() * camera.aperture_mm() / camera.sensor.pixel_pitch_mm;
    let corner = if camera.main_lens.aperture == Aperture::Square { std::f64::consts::SQRT_2 } else { 1.0 };
    let spare_px = 0.5 * (second.diameter_px - corner * width_px) - DVec2::from(second.aside_px).length();
    spare_px / second.slope.abs().max(1e-9)
}

/// The Fourier transform of a stop's image: of even light, and of light that falls from 1 in the middle to 0 at the rim
/// with the square of the distance; for a square, along x plus along y.
struct StopSeries {
    aperture: Aperture,
    half_px: f64,
}

impl StopSeries {
    fn at(&self, frequency: DVec2) -> [f64; 2] {
        let half = self.half_px;
        match self.aperture {
            Aperture::Circle => {
                let area = PI * half * half;
                let k = 2.0 * PI * half * frequency.length();
                if k < 1e-3 {
                    return [area, 0.5 * area];
                }
                let (j0, j1) = (libm::j0(k), libm::j1(k));
                [area * 2.0 * j1 / k, area * 4.0 * (2.0 * j1 / k - j0) / (k * k)]
            }
            Aperture::Square => {
                let [x, y] = [frequency.x, frequency.y].map(|f| line(half, 2.0 * PI * half * f));
                [x[0] * y[0], 0.5 * (x[1] * y[0] + x[0] * y[1])]
            }
        }
    }
}

/// Integrals over -half to half of cos(k t / half), and of that times 1 - (t / half)^2.
fn line(half: f64, k: f64) -> [f64; 2] {
    if k.abs() < 1e-2 {
        return [2.0 * half, 4.0 / 3.0 * half];
    }
    [2.0 * half * k.sin() / k, 4.0 * half * (k.sin() - k * k.cos()) / (k * k * k)]
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
