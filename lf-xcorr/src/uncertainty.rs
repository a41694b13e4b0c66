//! How uncertain a vector is, from how its particle images disagree.
//!
//! After B. Wieneke, "PIV uncertainty quantification from correlation statistics", Meas. Sci. Technol. 26 (2015): once the
//! two volumes lie on each other, the correlation at one voxel to the left equals that at one to the right, and every voxel
//! adds to their difference what it has of its own disagreement. The variance of the difference is the sum of the variances
//! of its parts, and the shape of the peak turns it into a displacement.
//!
//! Equation, along each axis e, for a part of the window: `g = ((C+ - C-) / C - (A+ - A-) / 2A - (B+ - B-) / 2B) / 2`, its share
//! of the slope of the logarithm of the score, C, A and B being the sums of products and squares of the whole window. The
//! displacement that the part asks for is the peak's covariance times g.
//!
//! Departure: the parts are particle images, as far as they are inside the window, and not pixels with a correlation length
//! found from them. A light-field particle is long, bright and rare; what happens inside it is one event, and windows hold
//! ten of them. The variance is that of the window's mean over particle images: n / (n - 1) times the sum of squares about
//! it, n being the effective number, (sum of shares)^2 / sum of squared shares. Repeats make it grow ([`crate::response`]).
//!
//! To this scatter is added, in squares, what no scatter shows: the part of the field that the windows are too large for, and
//! a floor.

use crate::lattice::Lattice;
use crate::level::Vector;
use crate::overlay::{Overlay, Voxel};
use crate::response::Noise;
use crate::sparse::Rows;
use rayon::prelude::*;

/// What the particle images of a window say of its vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Statistics {
    /// Standard uncertainty, voxels; NaN where hardly more than one particle image matters, and along an
    /// axis on which the correlation has no peak.
    pub uncertainty_vox: [f64; 3],
    /// Particle images whose top is in the window, those of all pairs.
    pub particles: usize,
}

/// What is the same for all vectors of a pass.
pub(crate) struct OfPass {
    /// What the peaks' variance along each axis is short of that in the volumes laid on each other, voxels squared.
    pub widened_vox2: f64,
    /// What becomes of noise.
    pub noise: Noise,
}

/// The statistics of every window, from the volumes laid on each other, the vectors, what of each the windows are too large
/// for, voxels, and the share of the light smoothing that repeats started from.
pub(crate) fn statistics(
    matched: &[[Rows; 2]],
    lattice: &Lattice,
    vectors: &[Vector],
    unresolved: &[[f64; 3]],
    light: &[[f64; 3]],
    pass: &OfPass,
) -> Vec<Statistics> {
    let [x, y, z] = &lattice.axes;
    let (nx, ny) = (x.cells.len(), y.cells.len());
    let cells = nx * ny * z.cells.len();
    let mut parts: Vec<Vec<Part>> = vec![Vec::new(); cells];
    let mut first_particle = 0u64;
    for (number, pair) in matched.iter().enumerate() {
        let overlay = Overlay::new(pair);
        let found: Vec<Vec<Part>> = (0..cells)
            .into_par_iter()
            .map(|cell| {
                let ranges = [&x.cells[cell % nx], &y.cells[cell / nx % ny], &z.cells[cell / nx / ny]];
                let mut found = Vec::new();
                overlay.visit(ranges, |voxel| {
                    let mut part = Part::of(&voxel);
                    (part.pair, part.particle) = (number, part.particle + first_particle);
                    match found.iter_mut().rev().find(|other: &&mut Part| other.particle == part.particle) {
                        Some(same) => same.add(&part),
                        None => found.push(part),
                    }
                });
                found
            })
            .collect();
        parts.iter_mut().zip(found).for_each(|(parts, found)| parts.extend(found));
        first_particle += overlay.particles() as u64;
    }
    let voxels = lattice.axes.iter().map(|axis| axis.window).product::<usize>() as f64;
    (0..lattice.count())
        .into_par_iter()
        .map(|node| {
            let [i, j, k] = lattice.node(node);
            let mut window = Vec::new();
            for cz in z.spans[k].clone() {
                for cy in y.spans[j].clone() {
                    for cx in x.spans[i].clone() {
                        window.extend_from_slice(&parts[cx + nx * (cy + ny * cz)]);
                    }
                }
            }
            of_window(joined(window), voxels, &vectors[node], unresolved[node], light[node], pass)
        })
        .collect()
}

/// What a particle image adds to a window's sums.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    /// Which pair of volumes.
    pair: usize,
    particle: u64,
    tops: usize,
    /// Sum of first x second, and of each, and of each squared.
    product: f64,
    light: [f64; 2],
    squares: [f64; 2],
    /// Sums of products at +1 and at -1 voxel along each axis.
    shifted: [[f64; 2]; 3],
    /// How much the sums of squares of the first, and of the second, change from -1 to +1.
    flux: [[f64; 2]; 3],
}

impl Part {
    fn of(voxel: &Voxel) -> Self {
        let [a, b] = voxel.light.map(f64::from);
        let next = voxel.next.map(|light| light.map(f64::from));
        Self {
            pair: 0,
            particle: voxel.particle as u64,
            tops: voxel.top as usize,
            product: a * b,
            light: [a, b],
            squares: [a * a, b * b],
            shifted: next.map(|[an, bn]| [a * bn, an * b]),
            flux: next.map(|[an, bn]| [a * a - an * an, bn * bn - b * b]),
        }
    }

    fn add(&mut self, other: &Self) {
        self.tops += other.tops;
        self.product += other.product;
        for i in 0..2 {
            self.light[i] += other.light[i];
            self.squares[i] += other.squares[i];
            for axis in 0..3 {
                self.shifted[axis][i] += other.shifted[axis][i];
                self.flux[axis][i] += other.flux[axis][i];
            }
        }
    }
}

/// One part for each particle image.
fn joined(mut parts: Vec<Part>) -> Vec<Part> {
    parts.sort_by_key(|part| part.particle);
    parts.dedup_by(|next, kept| {
        let same = next.particle == kept.particle;
        if same {
            kept.add(next);
        }
        same
    });
    parts
}

fn of_window(
    parts: Vec<Part>,
    voxels: f64,
    vector: &Vector,
    unresolved: [f64; 3],
    light: [f64; 3],
    pass: &OfPass,
) -> Statistics {
    let mut sum = Part::default();
    parts.iter().for_each(|part| sum.add(part));
    let unknown = Statistics { uncertainty_vox: [f64::NAN; 3], particles: sum.tops };
    let Some(reading) = vector.reading() else { return unknown };
    let mut covariance = reading.covariance_vox2;
    (0..3).for_each(|axis| covariance[axis][axis] += pass.widened_vox2);

    // The window's sums, each pair's about its own means.
    let (mut mean, mut level) = (0.0, [0.0; 2]);
    for pair in parts.chunk_by(|a, b| a.pair == b.pair) {
        let light: [f64; 2] = std::array::from_fn(|i| pair.iter().map(|part| part.light[i]).sum());
        mean += light[0] * light[1] / voxels;
        (0..2).for_each(|i| level[i] += light[i] * light[i] / voxels);
    }
    let squares: [f64; 2] = std::array::from_fn(|i| sum.squares[i] - level[i]);
    let products: [f64; 3] = std::array::from_fn(|axis| 0.5 * (sum.shifted[axis][0] + sum.shifted[axis][1]) - mean);
    let shares = parts.iter().map(|part| part.product / sum.product);
    let count = shares.clone().map(|share| share * share).sum::<f64>().recip();
    if !(count > FEWEST && squares[0] > 0.0 && squares[1] > 0.0) {
        return unknown;
    }
    // An axis along which there is no neighbour, as in a volume one voxel thick, has no slope and no uncertainty.
    let told = |axis: usize| products[axis] > 0.0 && covariance[axis][axis].is_finite();
    let asked = |part: &Part| -> [f64; 3] {
        let slope: [f64; 3] = std::array::from_fn(|axis| {
            if !told(axis) {
                return 0.0;
            }
            let [plus, minus] = part.shifted[axis];
            let [first, second] = part.flux[axis];
            0.5 * ((plus - minus) / products[axis] - 0.5 * first / squares[0] - 0.5 * second / squares[1])
        });
        std::array::from_fn(|a| (0..3).filter(|&b| told(b)).map(|b| covariance[a][b] * slope[b]).sum())
    };
    let whole = asked(&sum);
    let mut variance = [0.0; 3];
    for (part, share) in parts.iter().zip(shares) {
        let own = asked(part);
        (0..3).for_each(|axis| variance[axis] += (own[axis] - share * whole[axis]).powi(2));
    }
    let few = 1.0 + FEW / (count - 1.0);
    let uncertainty_vox = std::array::from_fn(|axis| {
        if !told(axis) {
            return f64::NAN;
        }
        // Where the predictor was widely smoothed, no noise came back from it.
        let gain = 1.0 + light[axis] * (pass.noise.gain - 1.0);
        let scatter = gain * few * (variance[axis] * count / (count - 1.0)).sqrt();
        // Scatter makes believe that something is missing: that much is taken off again.
        let unresolved = unresolved[axis].powi(2) - (pass.noise.taken_for_unresolved * scatter).powi(2);
        (scatter.powi(2) + unresolved.max(0.0) + FLOOR_VOX * FLOOR_VOX).sqrt()
    });
    Statistics { uncertainty_vox, particles: sum.tops }
}

/// Constant: of few parts the scatter is itself uncertain. Student's t of n - 1 degrees of freedom covers what a normal
/// distribution covers in one standard deviation in 1 + 1 / 2 (n - 1), to 3 % from n = 4 on.
const FEW: f64 = 0.5;

/// Constant: what the spline of `deform` and the fit leave on particles of 0.75 voxel without any noise.
const FLOOR_VOX: f64 = 0.001;

/// Constant: with fewer effective particle images than this there is no spread to speak of.
const FEWEST: f64 = 1.5;
