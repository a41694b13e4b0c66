//! How a flow changes, place by place, found in the pairs themselves: the scales that make them most likely.

use super::log_field::LogField;
use super::process::{Process, Scales, Sites};
use crate::vectors::Nodes;
use glam::DVec3;
use lf_core::statistics::median;
use rayon::prelude::*;
use std::f64::consts::LN_2;

/// Constant: distance over which a flow is expected to change, in mean distances of pairs, and the spread of its
/// natural logarithm. It matters where there are few pairs.
const LENGTH: f64 = 2.5;
const SPREAD: f64 = 1.0;
/// Constant: minimum and maximum length, in mean distances of pairs.
const LENGTHS: [f64; 2] = [0.35, 11.2];
/// Constant: spread of the natural logarithm of the misfit, and its bounds.
const MISFIT_SPREAD: f64 = 0.35;
const MISFITS: [f64; 2] = [0.25, 8.0];
/// Constants: minimum strength over the uncertainty of a displacement, and maximum over the spread of displacements.
const WEAKEST: f64 = 0.25;
const STRONGEST: f64 = 64.0;
/// Constant: maximum number of passes over all directions.
const PASSES: usize = 6;
/// Constant: directions of the search, in powers of length, strength and misfit. A smooth flow is as likely with a
/// longer length and more strength, so the search also follows this ridge. One axis at a time, then all together.
const ALONE: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 2.0, 0.0]];
const TOGETHER: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.5]];

/// Scales whose logarithms differ by less, as steps there and back do by rounding, are the same.
const SAME: f64 = 1e-9;
/// Numbers of a set of scales: three lengths, three strengths, misfit.
const NUMBERS: usize = 7;

/// Scales on a grid of windows.
pub(crate) struct ScaleField {
    field: LogField<NUMBERS>,
    /// Numbers of the pairs that determine the scales of each node.
    pairs: Vec<Vec<usize>>,
}

/// The measures of all pairs, mm.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Usual {
    /// Mean distance of pairs.
    pub apart: f64,
    /// Standard uncertainty of a displacement across the depth.
    pub uncertain: f64,
}

impl ScaleField {
    /// `near` gives the pairs about a place by their numbers, and `sites` what they measure. Nodes whose pairs are as
    /// in `before` keep their scales.
    pub fn new(
        nodes: Nodes,
        usual: Usual,
        near: impl Fn(DVec3) -> Vec<usize> + Sync,
        sites: impl Fn(&[usize]) -> Sites + Sync,
        before: Option<&Self>,
    ) -> Self {
        let of_node = |node: usize| {
            let pairs = near(nodes.place(node));
            let known = before.filter(|before| before.pairs[node] == pairs).map(|before| before.field.logs[node]);
            (known.unwrap_or_else(|| likeliest(&sites(&pairs), usual)), pairs)
        };
        let (logs, pairs) = (0..nodes.count()).into_par_iter().map(of_node).unzip();
        Self { field: LogField { nodes, logs }, pairs }
    }

    /// The misfit: the median of all nodes.
    pub fn misfit(&self) -> f64 {
        median(&mut self.field.logs.iter().map(|logs| logs[NUMBERS - 1].exp()).collect::<Vec<f64>>())
    }

    /// The scales at a place.
    pub fn at(&self, place_mm: DVec3) -> Scales {
        scales(self.field.at(place_mm))
    }
}

impl Scales {
    /// The scales under which some displacements are most likely.
    pub fn likeliest(sites: &Sites, usual: Usual) -> Self {
        scales(likeliest(sites, usual).map(f64::exp))
    }
}

fn scales(logs: [f64; NUMBERS]) -> Scales {
    Scales { length: DVec3::from_slice(&logs), strength: DVec3::from_slice(&logs[3..]), misfit: logs[6] }
}

/// All directions of the search.
fn directions() -> impl Iterator<Item = [f64; NUMBERS]> {
    let of = |[length, strength, misfit]: [f64; 3], axes: [f64; 3]| {
        let [x, y, z] = axes;
        [length * x, length * y, length * z, strength * x, strength * y, strength * z, misfit]
    };
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let alone = ALONE.into_iter().flat_map(move |powers| axes.map(|axes| of(powers, axes)));
    alone.chain(TOGETHER.map(|powers| of(powers, [1.0; 3])))
}

/// The scales under which the displacements are most likely, found direction by direction in factors of two.
fn likeliest(sites: &Sites, usual: Usual) -> [f64; NUMBERS] {
    let count = sites.shifts.len().max(1) as f64;
    let mean = sites.shifts.iter().sum::<DVec3>() / count;
    let spread = (sites.shifts.iter().map(|shift| (*shift - mean).powf(2.0)).sum::<DVec3>() / count).map(f64::sqrt);
    let low = (WEAKEST * usual.uncertain).ln();
    let length = (LENGTH * usual.apart).ln();
    let lengths = LENGTHS.map(|length| (length * usual.apart).ln());
    let high = (STRONGEST * spread.max_element()).ln().max(low);
    let likelihood = |logs: &[f64; NUMBERS]| {
        let far2: f64 = logs[..3].iter().map(|log| ((log - length) / SPREAD).powi(2)).sum();
        let far2 = far2 + (logs[NUMBERS - 1] / MISFIT_SPREAD).powi(2);
        Process::new(sites, scales(logs.map(f64::exp)))
            .map_or(f64::NEG_INFINITY, |process| process.log_likelihood() - 0.5 * far2)
    };
    let [x, y, z] = spread.to_array().map(|spread| spread.ln().clamp(low, high));
    let bounds = [lengths, lengths, lengths, [low, high], [low, high], [low, high], MISFITS.map(f64::ln)];
    // Start from a flow that changes much, and from an even one whose pairs scatter more than they state.
    let starts = [[length, length, length, x, y, z, 0.0], [length, length, length, low, low, low, LN_2]];
    let mut known = Vec::new();
    let mut score = |logs: &[f64; NUMBERS]| looked_up(&mut known, logs, likelihood);
    let [(changing, one), (even, other)] = starts.map(|start| climbed(start, bounds, &mut score));
    if other > one { even } else { changing }
}

/// The score of some scales: the search comes back to the same ones again and again.
fn looked_up(
    known: &mut Vec<([f64; NUMBERS], f64)>,
    logs: &[f64; NUMBERS],
    score: impl Fn(&[f64; NUMBERS]) -> f64,
) -> f64 {
    let is_same = |other: &[f64; NUMBERS]| logs.iter().zip(other).all(|(a, b)| (a - b).abs() < SAME);
    if let Some((_, score)) = known.iter().find(|(other, _)| is_same(other)) {
        return *score;
    }
    let score = score(logs);
    known.push((*logs, score));
    score
}

/// The likeliest scales that can be reached from a start, and their score.
fn climbed(
    mut logs: [f64; NUMBERS],
    bounds: [[f64; 2]; NUMBERS],
    score: &mut dyn FnMut(&[f64; NUMBERS]) -> f64,
) -> ([f64; NUMBERS], f64) {
    let mut best = score(&logs);
    for _ in 0..PASSES {
        let before = best;
        for direction in directions() {
            for step in [-LN_2, LN_2] {
                loop {
                    let next =
                        std::array::from_fn(|n| (logs[n] + step * direction[n]).clamp(bounds[n][0], bounds[n][1]));
                    let reached = if next == logs { best } else { score(&next) };
                    if reached <= best || reached.is_nan() {
                        break;
                    }
                    (logs, best) = (next, reached);
                }
            }
        }
        if best <= before {
            break;
        }
    }
    (logs, best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// A shear along x in noise: its component is strong and long, the others are weak.
    #[test]
    fn a_shear_is_distinguished_from_noise() {
        let mut random = Pcg64Mcg::seed_from_u64(4);
        let mut place = || DVec3::from_array([(); 3].map(|()| random.random::<f64>() - 0.5));
        let mut sites = Sites::default();
        for _ in 0..30 {
            let at = 2.0 * place();
            sites.places.push(at);
            sites.shifts.push(1e-2 * at.z * DVec3::X + 1e-3 * place());
            sites.covariances.push(DMat3::from_diagonal(DVec3::splat(1e-6 / 12.0)));
        }
        let usual = Usual { apart: 0.6, uncertain: 1e-4 };
        let [length, _, _, x, y, z, _] = likeliest(&sites, usual);
        assert!(x > y + 2.0 && x > z + 2.0 && length.exp() > 0.8, "{length} {x} {y} {z}");
        assert!(y.exp() < 6e-4 && z.exp() < 6e-4, "{y} {z}");
        // Covariances that state a quarter of the variance.
        sites.covariances.iter_mut().for_each(|covariance| *covariance *= 0.25);
        let misfit = likeliest(&sites, usual)[NUMBERS - 1].exp();
        assert!((1.4..2.9).contains(&misfit), "{misfit}");
    }
}
