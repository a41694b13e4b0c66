//! How uncertain a vector is, from how the particle images of its window disagree.
//!
//! Method, after B. Wieneke, "PIV uncertainty quantification from correlation statistics", Meas. Sci. Technol. 26
//! (2015): once the two volumes lie on each other, the correlation at one voxel to the left equals that at one voxel to
//! the right, and every voxel adds its own disagreement to their difference. The variances of the parts add up, and the
//! shape of the peak turns their sum into a displacement.
//!
//! Equation, along each axis, for a part of the window: `g = ((C+ - C-) / C - (A+ - A-) / 2A - (B+ - B-) / 2B) / 2`.
//! This is the part's contribution to the slope of the logarithm of the score; C, A and B are the sums of products and
//! squares of the whole window. The displacement that the part asks for is the peak's covariance times g.
//!
//! Departure: the parts are particle images inside the window. The author takes pixels and finds a correlation length
//! from them. A light-field particle is long, bright and rare: its voxels disagree together, and a window holds ten
//! particles. The variance of the window's mean is n / (n - 1) times the sum of squares about the mean, with the
//! effective number n = (sum of shares)^2 / sum of squared shares. Repeats make it grow ([`super::response`]).
//!
//! Two things that no scatter shows are added in squares: the part of the field that the windows are too large to
//! resolve, and a floor.

use super::particle_images::{ParticleImages, Voxel};
use super::{response::Noise, vector::Vector};
use crate::correlate::{PeakFit, WindowGrid};
use crate::volumes::Rows;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Constant: the scatter of few images is itself uncertain. To cover the same probability as one standard deviation of
/// a normal distribution, Student's t of n - 1 degrees of freedom needs 1 + 1 / 2 (n - 1), to 3 % from n = 4 on.
const FEW: f64 = 0.5;

/// Constant: the error that deformation's spline and the fit leave on particles of 0.75 voxel without any noise.
const FLOOR_VOX: f64 = 0.001;
/// Constant: fewer effective particle images than this have no spread to speak of.
const FEWEST: f64 = 1.5;

pub(crate) struct Uncertainty {
    /// Standard uncertainty, voxels. NaN if hardly more than one particle image matters, and along an axis on which the
    /// correlation has no peak.
    pub std_vox: DVec3,
    /// Particle images of all pairs that have their top in the window.
    pub particles: usize,
}

/// The vectors of a pass, and the known causes of their errors.
pub(crate) struct Measured<'a> {
    pub windows: &'a WindowGrid,
    pub vectors: &'a [Vector],
    /// Part of each displacement that the windows are too large to resolve, voxels.
    pub unresolved_vox: &'a [DVec3],
    /// Fraction of the narrow smoothing in the predictor that repeats started from, by node and component.
    pub narrow_share: &'a [DVec3],
    /// Variance along each axis that the matched volumes have and the peaks do not, voxels squared.
    pub widened_vox2: f64,
    pub noise: Noise,
}

impl Measured<'_> {
    /// The uncertainty of every vector; `matched` are the pairs laid on each other.
    pub fn uncertainties(&self, matched: &[[Rows; 2]]) -> Vec<Uncertainty> {
        let cells = images_of_cells(matched, self.windows);
        let of_window = |node: usize| {
            let images = self.windows.cells_of(node).flat_map(|cell| cells[cell].iter().copied());
            self.of_window(node, &joined(images.collect()))
        };
        (0..self.windows.count()).into_par_iter().map(of_window).collect()
    }

    fn of_window(&self, node: usize, images: &[ImageSums]) -> Uncertainty {
        let mut sum = ImageSums::default();
        images.iter().for_each(|image| sum.add(image));
        let unknown = Uncertainty { std_vox: DVec3::NAN, particles: sum.tops };
        let Some(fit) = self.vectors[node].fit() else { return unknown };
        let shares = images.iter().map(|image| image.product / sum.product);
        let count = shares.clone().map(|share| share * share).sum::<f64>().recip();
        let peak = WindowPeak::new(images, &sum, self.windows, fit, self.widened_vox2);
        if !(count > FEWEST && peak.squares[0] > 0.0 && peak.squares[1] > 0.0) {
            return unknown;
        }

        // The scatter of the displacements that the images ask for.
        let whole = peak.displacement(&sum);
        let mut variance = DVec3::ZERO;
        for (image, share) in images.iter().zip(shares) {
            let residual = peak.displacement(image) - share * whole;
            variance += residual * residual;
        }
        let few = 1.0 + FEW / (count - 1.0);
        let std_vox = [0, 1, 2].map(|axis| {
            if !peak.has_slope[axis] {
                return f64::NAN;
            }
            // A widely smoothed predictor brings no noise back.
            let gain = 1.0 + self.narrow_share[node][axis] * (self.noise.gain - 1.0);
            let scatter = gain * few * (variance[axis] * count / (count - 1.0)).sqrt();
            // Scatter looks like unresolved flow: subtract that much again.
            let unresolved = self.unresolved_vox[node][axis].powi(2);
            let unresolved = unresolved - (self.noise.taken_for_unresolved * scatter).powi(2);
            (scatter.powi(2) + unresolved.max(0.0) + FLOOR_VOX * FLOOR_VOX).sqrt()
        });
        Uncertainty { std_vox: std_vox.into(), particles: sum.tops }
    }
}

/// The particle images in every cell of the window grid, cut at the cell's sides; x fastest.
fn images_of_cells(matched: &[[Rows; 2]], windows: &WindowGrid) -> Vec<Vec<ImageSums>> {
    let mut cells: Vec<Vec<ImageSums>> = vec![Vec::new(); windows.cell_count()];
    let mut first_image = 0u64;
    for (number, pair) in matched.iter().enumerate() {
        let images = ParticleImages::new(pair);
        let in_cell = |cell: usize| {
            let mut found: Vec<ImageSums> = Vec::new();
            images.visit(windows.cell(cell), |voxel| {
                let sums = ImageSums::new(&voxel, number, first_image);
                match found.iter_mut().rev().find(|other| other.image == sums.image) {
                    Some(same) => same.add(&sums),
                    None => found.push(sums),
                }
            });
            found
        };
        let found: Vec<Vec<ImageSums>> = (0..cells.len()).into_par_iter().map(in_cell).collect();
        cells.iter_mut().zip(found).for_each(|(cell, found)| cell.extend(found));
        first_image += images.count() as u64;
    }
    cells
}

/// The contribution of a particle image to the sums of a window. Pairs and images have numbers.
#[derive(Clone, Copy, Default)]
struct ImageSums {
    pair: usize,
    image: u64,
    /// 1 if the top of the image is here.
    tops: usize,
    /// Sum of first x second; sums of the first and of the second, plain and squared.
    product: f64,
    light: [f64; 2],
    squares: [f64; 2],
    /// Sum of first x second, with the second at +1 and at -1 voxel along each axis.
    plus: DVec3,
    minus: DVec3,
    /// Change of the sums of squares of the first and of the second from -1 to +1 voxel along each axis.
    flux: [DVec3; 2],
}

impl ImageSums {
    /// A voxel of pair number `pair`, whose images are numbered from `first_image` on.
    fn new(voxel: &Voxel, pair: usize, first_image: u64) -> Self {
        let [a, b] = voxel.light.map(f64::from);
        let [a_next, b_next] = [0, 1].map(|volume| DVec3::from_array(voxel.next.map(|light| f64::from(light[volume]))));
        Self {
            pair,
            image: voxel.image as u64 + first_image,
            tops: voxel.is_top as usize,
            product: a * b,
            light: [a, b],
            squares: [a * a, b * b],
            plus: a * b_next,
            minus: a_next * b,
            flux: [a * a - a_next * a_next, b_next * b_next - b * b],
        }
    }

    fn add(&mut self, other: &Self) {
        self.tops += other.tops;
        self.product += other.product;
        self.plus += other.plus;
        self.minus += other.minus;
        for i in 0..2 {
            self.light[i] += other.light[i];
            self.squares[i] += other.squares[i];
            self.flux[i] += other.flux[i];
        }
    }
}

/// The pieces of each particle image put together, in the order of the images.
fn joined(mut pieces: Vec<ImageSums>) -> Vec<ImageSums> {
    pieces.sort_by_key(|piece| piece.image);
    let total = |pieces: &[ImageSums]| {
        let mut total = pieces[0];
        pieces[1..].iter().for_each(|piece| total.add(piece));
        total
    };
    pieces.chunk_by(|a, b| a.image == b.image).map(total).collect()
}

/// The correlation peak of a window, and the sums that turn a disagreement into a displacement.
struct WindowPeak {
    /// Sums of squares of the first and of the second volume about the mean.
    squares: [f64; 2],
    /// Sum of products about the mean, at one voxel along each axis.
    products: DVec3,
    /// Covariance of the peak, voxels squared; 0 along an axis without slope.
    covariance: DMat3,
    /// Whether the correlation has a slope along an axis. It has none in a volume one voxel thick.
    has_slope: [bool; 3],
}

impl WindowPeak {
    fn new(images: &[ImageSums], sum: &ImageSums, windows: &WindowGrid, fit: &PeakFit, widened_vox2: f64) -> Self {
        let voxels = windows.window().iter().product::<usize>() as f64;
        // The volumes of each pair are taken about their own means.
        let (mut mean_product, mut mean_squares) = (0.0, [0.0; 2]);
        for pair in images.chunk_by(|a, b| a.pair == b.pair) {
            let light: [f64; 2] = std::array::from_fn(|i| pair.iter().map(|image| image.light[i]).sum());
            mean_product += light[0] * light[1] / voxels;
            (0..2).for_each(|i| mean_squares[i] += light[i] * light[i] / voxels);
        }
        let products = 0.5 * (sum.plus + sum.minus) - mean_product;
        let mut covariance = fit.covariance_vox2;
        (0..3).for_each(|axis| covariance[axis][axis] += widened_vox2);
        let has_slope = [0, 1, 2].map(|axis| products[axis] > 0.0 && covariance[axis][axis].is_finite());
        for (a, b) in (0..3).flat_map(|a| (0..3).map(move |b| (a, b))) {
            if !(has_slope[a] && has_slope[b]) {
                covariance[a][b] = 0.0;
            }
        }
        let squares = std::array::from_fn(|i| sum.squares[i] - mean_squares[i]);
        Self { squares, products, covariance: DMat3::from_cols_array_2d(&covariance), has_slope }
    }

    /// The displacement that a part of the window asks for, voxels.
    fn displacement(&self, part: &ImageSums) -> DVec3 {
        let [first, second] = part.flux;
        let slope =
            (part.plus - part.minus) / self.products - 0.5 * first / self.squares[0] - 0.5 * second / self.squares[1];
        self.covariance * DVec3::from_array([0, 1, 2].map(|a| if self.has_slope[a] { 0.5 * slope[a] } else { 0.0 }))
    }
}
