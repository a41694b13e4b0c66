//! The blur on the sensor, by how soft the rims of the lenslet images are, and the blades of an iris. Width, Gaussian
//! and polygon come by Levenberg-Marquardt from the mean of many cells, light and ground linearly.

use super::image_lattice::ImageLattice;
use super::white_cell::{Edge, WhiteCell};
use crate::fit::search::Search;
use glam::DVec2;
use lf_core::camera::{Aperture, Blades, Blur, Camera, GREEN_NM};
use nalgebra::{DMatrix, DVector};
use ndarray::Array2;
use std::f64::consts::PI;

/// The rims of lenslet images.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rims {
    /// None if the rims do not show it.
    pub blur: Option<RimBlur>,
    /// None for a round or a square stop.
    pub iris: Option<Iris>,
    /// How much darker a lenslet image is at its rim than in its middle, as a share. 0 if the rims show no edge.
    pub falls: f64,
}

/// An iris whose blades leave a polygon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iris {
    /// The polygon.
    pub blades: Blades,
    /// Distance of its corners from the middle of a lenslet image, px.
    pub half_px: f64,
    /// Its middle, from where the lattice has the middle of the lenslet image, px.
    pub aside_px: DVec2,
}

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

/// Largest uncertainty of a blur that is believed, px, and largest misfit over the light. A blur below SEEN_PX may be
/// as uncertain as one of SEEN_PX with the same uncertainty of its square.
const MOST_UNCERTAIN_PX: f64 = 0.08;
const SEEN_PX: f64 = 0.2;
const MOST_MISFIT: f64 = 0.15;
/// Uncertainty of the model itself, px^2: the largest error of the square of the blur in images without noise.
const MODEL_PX2: f64 = 0.004;
/// Uncertainty that light which the model does not follow adds, px^2 for a misfit of all the light.
const UNFOLLOWED_PX2: f64 = 0.5;
/// Variance at the start, px^2.
const START_PX2: f64 = 0.2;
/// A polygon has at least this many blades, and at most.
const BLADES: [u32; 2] = [5, 16];
/// A polygon is tried if the rim's distance from the middle changes by this amplitude, px, and the most of them. It is
/// believed if it leaves less than this share of a disc's squares, and if its corners are this much farther out than
/// its sides, px: at 0.2 px lf-fit lost more by the pixels that nine blades cut than by taking the stop for round
/// (depths 1.24 px off, and 0.55).
const TRIED_PX: f64 = 0.03;
const TRIED: usize = 3;
const LEAST_BLADE_PX: f64 = 0.3;
const LEAST_GAIN: f64 = 0.5;
/// No other polygon is tried after one that leaves less than this share.
const CLEAR_GAIN: f64 = 0.1;
/// Directions that a cell hardly shows have no waves: this share of the mean weight is added to each.
const RIDGE: f64 = 0.01;

/// The rims of a white image. The camera is known, with the stop of the image.
pub fn rims(white: &Array2<f32>, camera: &Camera, lattice: &ImageLattice) -> Rims {
    let Some(mut cell) = WhiteCell::new(white, camera, lattice) else { return Rims::default() };
    let half_px = 0.5 * camera.stop_image_px();
    let blur = camera.blur.unwrap_or_default();
    let start = Edge { half_px, variance_px2: START_PX2, blades: None, aside_px: DVec2::ZERO };
    let round = SoftEdge::nearest(&cell, start);
    // Two discs that cut each other look like a polygon, too.
    let may_be_iris = camera.main_lens.aperture == Aperture::Circle && lattice.second_stop.is_none();
    let iris = round.as_ref().filter(|_| may_be_iris).and_then(|round| round.iris(&cell));
    let Some(mut edge) = iris.or(round) else { return Rims::default() };
    let mut wavelength_nm = blur.wavelength_nm;
    if wavelength_nm.is_none() && edge.blur().is_some() {
        let green_nm = Some(camera.wavelength_of_nm(GREEN_NM));
        let green = Blur { wavelength_nm: green_nm, ..blur };
        cell.set_light(&Camera { blur: Some(green), ..camera.clone() });
        let other = SoftEdge::nearest(&cell, Edge { variance_px2: START_PX2, ..edge.edge });
        if let Some(other) = other.filter(|other| other.squares() < edge.squares() && other.blur().is_some()) {
            (edge, wavelength_nm) = (other, green_nm);
        }
    }
    let Edge { half_px, blades, aside_px, .. } = edge.edge;
    let seen = edge.blur();
    Rims {
        blur: seen.map(|[sigma_px, uncertainty_px]| RimBlur { sigma_px, uncertainty_px, wavelength_nm }),
        iris: blades.map(|blades| Iris { blades, half_px, aside_px }),
        falls: seen.map_or(0.0, |_| 1.0 - edge.light[1] / edge.light[0]),
    }
}

/// A stop's image that fits the rims.
struct SoftEdge {
    edge: Edge,
    /// Residuals, and their derivatives by the logarithm of the half width, the variance, and the blades' turn, apothem
    /// and place.
    residuals: DVector<f64>,
    slopes: DMatrix<f64>,
    /// In the middle and at the rim.
    light: [f64; 2],
}

impl SoftEdge {
    /// The stop's image that fits best, from one on, and with its number of blades.
    fn nearest(cell: &WhiteCell, start: Edge) -> Option<Self> {
        let free = if start.blades.is_some() { 6 } else { 2 };
        let search = Search {
            slope_steps: &[1e-4, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3][..free],
            damping: 1e-3,
            factors: [0.2, 10.0],
            least_square: 0.0,
            least_gain: 1e-8,
        };
        let residuals = |edge: &Edge| Some(cell.residuals(edge)?.0);
        let edge = search.run(start, residuals, Edge::moved)?;
        let (here, light) = cell.residuals(&edge)?;
        let slopes = search.slopes(&edge, &here, residuals, Edge::moved)?;
        Some(Self { edge, residuals: here, slopes, light })
    }

    /// The polygon that fits better than this disc. None if none does.
    fn iris(&self, cell: &WhiteCell) -> Option<Self> {
        let mut best: Option<Self> = None;
        for start in self.polygons(cell) {
            let found = Self::nearest(cell, start);
            best = best.into_iter().chain(found).min_by(|a, b| a.squares().total_cmp(&b.squares()));
            if best.as_ref().is_some_and(|best| best.squares() < CLEAR_GAIN * self.squares()) {
                break;
            }
        }
        let is_seen = |edge: Edge| edge.blades.is_some_and(|one| edge.half_px * (1.0 - one.apothem) > LEAST_BLADE_PX);
        best.filter(|best| is_seen(best.edge) && best.squares() < LEAST_GAIN * self.squares())
    }

    /// The polygons that a disc's residuals look like. On a hexagonal lattice five blades look like seven, too.
    fn polygons(&self, cell: &WhiteCell) -> Vec<Edge> {
        // How far out the rim is, in each direction, over its mean distance: a cosine and a sine for each number.
        let directions: Vec<f64> = cell.bins_px().map(DVec2::to_angle).collect();
        let most = BLADES[1] as usize;
        let lines = DMatrix::from_fn(directions.len(), 2 * most, |n, k| {
            let angle = (k / 2 + 1) as f64 * directions[n];
            -self.slopes[(n, 0)] * if k % 2 == 0 { angle.cos() } else { angle.sin() }
        });
        let normal = lines.tr_mul(&lines);
        let ridge = DMatrix::identity(2 * most, 2 * most) * (RIDGE * normal.trace() / (2 * most) as f64);
        let Some(solver) = (normal + ridge).cholesky() else { return Vec::new() };
        let rim = solver.solve(&lines.tr_mul(&self.residuals));
        let waves = (BLADES[0]..=BLADES[1]).map(|count| {
            let at = 2 * (count as usize - 1);
            (count, DVec2::new(rim[at], rim[at + 1]))
        });
        let half_px = self.edge.half_px;
        let mut waves: Vec<(u32, DVec2)> = waves.filter(|wave| wave.1.length() * half_px > TRIED_PX).collect();
        waves.sort_by(|a, b| b.1.length().total_cmp(&a.1.length()));
        waves.truncate(TRIED);
        let edge = |(count, wave): (u32, DVec2)| {
            // A side is a parabola, about: its first wave is 4 / pi^2 of its depth, its mean a third from the bottom.
            let depth = (0.25 * PI * PI * wave.length()).min(1.0 - Blades::straight(count));
            let turn_rad = wave.to_angle() / f64::from(count);
            let blades = Some(Blades { count, turn_rad, apothem: 1.0 - depth });
            Edge { half_px: half_px / (1.0 - 2.0 / 3.0 * depth), blades, ..self.edge }
        };
        waves.into_iter().map(edge).collect()
    }

    fn squares(&self) -> f64 {
        self.residuals.norm_squared()
    }

    /// The Gaussian of the blur, px, and its standard uncertainty. None if the rims do not show it.
    fn blur(&self) -> Option<[f64; 2]> {
        let Edge { half_px, variance_px2, .. } = self.edge;
        let count = self.residuals.len();
        let inverse = self.slopes.tr_mul(&self.slopes).try_inverse()?;
        let scatter = self.squares() / count.saturating_sub(5).max(1) as f64;
        let misfit = self.residuals.norm() / (0.5 * (self.light[0] + self.light[1]) * (count as f64).sqrt());
        let uncertainty_px2 = (inverse[(1, 1)] * scatter).sqrt().hypot(MODEL_PX2).hypot(UNFOLLOWED_PX2 * misfit);
        // The root of v + u is u / (2 sigma) above sigma, and the root of u where v is 0.
        let uncertainty_px = |px2: f64| (px2 + uncertainty_px2).sqrt() - px2.sqrt();
        let is_clear = uncertainty_px(variance_px2.max(SEEN_PX * SEEN_PX)) < MOST_UNCERTAIN_PX
            && variance_px2 > -3.0 * uncertainty_px2
            && misfit < MOST_MISFIT
            && variance_px2 < half_px * half_px;
        let px2 = variance_px2.max(0.0);
        is_clear.then(|| [px2.sqrt(), uncertainty_px(px2)])
    }
}
