//! The uncertainty of a vector, from the disagreement of the particle images in its window.
//!
//! Method, after B. Wieneke, "PIV uncertainty quantification from correlation statistics", Meas. Sci. Technol.
//! (2015): in matched volumes the correlation one voxel to the left equals the one a voxel to the right, and every
//! voxel adds its own disagreement to their difference. The variances of the parts add up, and the shape of the peak
//! turns their sum into a displacement.
//!
//! Equation, along each axis, for a part of the window: `g = ((C+ - C-) / C - (A+ - A-) / 2A - (B+ - B-) / 2B) / 2`.
//! This is the part's contribution to the slope of the logarithm of the score; C, A and B are the sums of products and
//! squares of the whole window. The displacement that the part measures is the peak's covariance times g.
//!
//! Departure: the parts are particle images inside the window. The author takes pixels and estimates their correlation
//! length. A light-field particle is long, bright and rare: its voxels disagree together, and a window holds ten
//! particles. The variance of the window's mean is n / (n - 1) times the sum of squares about the mean, with the
//! effective number n = (sum of shares)^2 / sum of squared shares. Repeats make it grow ([`super::response`]).
//!
//! Two contributions that scatter does not show are added in squares: the part of the flow that bends inside a window
//! ([`super::bend`]), and a floor.

use super::image_sums::{ImageSums, images_of_cells, joined};
use super::{bend, response::Noise, vector::Vector};
use crate::correlate::{PeakFit, WindowGrid};
use crate::volumes::Rows;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Constant: the scatter of few images is itself uncertain. To cover the same probability as one standard deviation of
/// a normal distribution, Student's t of n - 1 degrees of freedom needs 1 + 1 / 2 (n - 1), to 3 % from n = 4 on.
const FEW: f64 = 0.5;

/// Constant: the error that deformation's spline and the fit leave on particles of 0.75 voxel without any noise.
const FLOOR_VOX: f64 = 0.0008;
/// Constant: minimum number of effective particle images that have a spread.
const MIN_IMAGES: f64 = 1.5;

pub(crate) struct Uncertainty {
    /// Standard uncertainty, voxels. NaN with hardly more than one particle image, and along an axis without a
    /// correlation peak.
    pub std_vox: DVec3,
    /// Particle images of all pairs that have their top in the window.
    pub particles: usize,
}

/// The vectors of a pass, and the known causes of their errors.
pub(crate) struct Measured<'a> {
    pub windows: &'a WindowGrid,
    pub vectors: &'a [Vector],
    /// Part of each displacement that the windows are too large to resolve, voxels, if the volumes are plain.
    pub unresolved_vox: Option<Vec<DVec3>>,
    /// Fraction of the narrow smoothing in the predictor that repeats started from, by node and component.
    pub narrow_share: &'a [DVec3],
    /// Variance along each axis that the matched volumes have and the peaks do not, voxels squared.
    pub widened_vox2: f64,
    pub noise: Noise,
}

/// The statistics of the particle images of a window.
struct Scatter {
    /// Standard deviation of the vector by the disagreement of the images, voxels; NaN if it is unknown.
    std_vox: DVec3,
    /// The bend of the flow, voxels squared; `None` if it is unknown.
    bend_vox2: Option<DVec3>,
    particles: usize,
}

impl Measured<'_> {
    /// The uncertainty of every vector; `matched` are the pairs deformed onto each other.
    pub fn uncertainties(&self, matched: &[[Rows; 2]]) -> Vec<Uncertainty> {
        let cells = images_of_cells(matched, self.windows);
        let of_window = |node: usize| {
            let images = self.windows.cells_of(node).flat_map(|cell| cells[cell].iter().copied());
            self.scatter(node, &joined(images.collect()))
        };
        let scatters: Vec<Scatter> = (0..self.windows.count()).into_par_iter().map(of_window).collect();
        let bends = bend::mean_squares(self.windows, scatters.iter().map(|scatter| scatter.bend_vox2).collect());
        let total = |(node, (scatter, bend)): (usize, (&Scatter, DVec3))| {
            let missing = bend.max(self.unresolved_vox2(node, scatter));
            let variance = scatter.std_vox * scatter.std_vox + missing + FLOOR_VOX * FLOOR_VOX;
            Uncertainty { std_vox: variance.map(f64::sqrt), particles: scatter.particles }
        };
        scatters.iter().zip(bends).enumerate().map(total).collect()
    }

    /// Square of the part of a displacement that the window is too large to resolve, in plain volumes.
    fn unresolved_vox2(&self, node: usize, scatter: &Scatter) -> DVec3 {
        let Some(unresolved) = &self.unresolved_vox else { return DVec3::ZERO };
        // Scatter looks like unresolved flow: subtract its contribution.
        let noise = self.noise.taken_for_unresolved * scatter.std_vox;
        (unresolved[node] * unresolved[node] - noise * noise).max(DVec3::ZERO)
    }

    fn scatter(&self, node: usize, images: &[ImageSums]) -> Scatter {
        let mut sum = ImageSums::default();
        images.iter().for_each(|image| sum.add(image));
        let unknown = Scatter { std_vox: DVec3::NAN, bend_vox2: None, particles: sum.tops };
        let Some(fit) = self.vectors[node].fit() else { return unknown };
        let shares = images.iter().map(|image| image.product / sum.product);
        let count = shares.clone().map(|share| share * share).sum::<f64>().recip();
        let peak = WindowPeak::new(images, &sum, self.windows, fit, self.widened_vox2);
        if !(count > MIN_IMAGES && peak.squares[0] > 0.0 && peak.squares[1] > 0.0) {
            return unknown;
        }

        // Take the displacements that the images measure, less their shares of the whole window's.
        let whole = peak.displacement(&sum);
        let residuals = images.iter().zip(shares).map(|(image, share)| peak.displacement(image) - share * whole);
        let residuals: Vec<DVec3> = residuals.collect();
        let variance = residuals.iter().map(|residual| residual * residual).sum::<DVec3>();
        let few = 1.0 + FEW / (count - 1.0);
        let known = DVec3::from_array(peak.has_slope.map(|has_slope| if has_slope { 1.0 } else { f64::NAN }));
        // A widely smoothed predictor returns no noise.
        let gain = 1.0 + self.narrow_share[node] * (self.noise.gain - 1.0);
        let std_vox = gain * few * (variance * count / (count - 1.0)).map(f64::sqrt) * known;
        let bend_vox2 = bend::square(&self.windows.voxels(node), images, &residuals, count / (count - 1.0));
        Scatter { std_vox, bend_vox2: (bend_vox2 * known).is_finite().then_some(bend_vox2), particles: sum.tops }
    }
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

    /// The displacement that a part of the window measures, voxels.
    fn displacement(&self, part: &ImageSums) -> DVec3 {
        let [first, second] = part.flux;
        let slope =
            (part.plus - part.minus) / self.products - 0.5 * first / self.squares[0] - 0.5 * second / self.squares[1];
        self.covariance * DVec3::from_array([0, 1, 2].map(|a| if self.has_slope[a] { 0.5 * slope[a] } else { 0.0 }))
    }
}
