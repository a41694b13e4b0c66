//! The smooth departure of lenslets from the perfect lattice through them.
//!
//! The perfect lattice is the best similarity (origin, rotation, pitch). The residuals are fitted by the polynomial of
//! position of the lowest degree that leaves only noise: degree 1 for an array that is stretched or sheared, degree 3
//! for the distortion of a relay lens. A higher degree must pass two tests, evidence and size. They prevent polynomials
//! that fit noise, and departures too small to matter.

use super::perfect_lattice::PerfectLattice;
use crate::fit::polynomial::{Polynomial, TiePoint};
use glam::{DMat2, DVec2};
use lf_core::lattice::{Centres, terms};
use std::collections::BTreeMap;

/// Highest degree that is tried. In photographic lenses distortion of fifth order is a thousandth of that of third.
const MOST_DEGREE: usize = 4;
/// Evidence that a higher degree needs, as a multiple of Schwarz's (1978) criterion: n ln(S before / S after) > p ln n
/// for n coordinates and p more coefficients. At 3, noise bends a lattice of a hundred lenslets in one of 10^6 images.
const EVIDENCE: f64 = 3.0;
/// Root mean square motion of the centres that a higher degree must bring, px. Sampling moves the frame's ends by this.
const WORTH_PX: f64 = 0.002;
/// Lenslets needed for each coefficient of a coordinate. With fewer, errors by sampling bend the lattice.
const LENSLETS: usize = 12;
/// Side of the blocks in which residuals are tested for correlation, lenslets, and fewest blocks along a side.
const BLOCK: f64 = 7.0;
const BLOCKS: f64 = 4.0;
/// Iterations that move the departure's constant term into the origin. Each squares the rest.
const GAUGE_STEPS: usize = 3;

/// A perfect lattice, and the departure of the lenslets from it. A perfect array has None and degree 0.
pub(crate) struct DepartureFit {
    pub perfect: PerfectLattice,
    pub centres: Option<Centres>,
    pub degree: usize,
}

impl DepartureFit {
    /// Fits lenslet centres, mm from the sensor's middle. `unit` holds the lattice vectors in pitches, `radius_mm` is
    /// for [`Centres`], `px_mm` is a pixel's length on the array. None if the centres do not span the plane.
    pub fn through(ties: &[TiePoint], unit: DMat2, radius_mm: f64, px_mm: f64) -> Option<Self> {
        let mut perfect = PerfectLattice::through(ties, unit)?;
        let departures = |perfect: &PerfectLattice| -> Vec<TiePoint> {
            let tie = |tie: &TiePoint| (perfect.at(unit * tie.0), tie.1 - perfect.at(unit * tie.0));
            ties.iter().map(tie).collect()
        };
        let left = departures(&perfect);
        let sum =
            |fit: &Polynomial| left.iter().map(|(place, rest)| rest.distance_squared(fit.at(*place))).sum::<f64>();
        let places = || ties.iter().map(|tie| tie.0);
        let count = 2.0 * ties.len() as f64
            / Polynomial::about(&left, MOST_DEGREE, DVec2::ZERO, radius_mm).map_or(1.0, |fit| {
                correlation_factor(places().zip(left.iter().map(|(place, rest)| *rest - fit.at(*place))))
            });
        let (mut degree, mut best) = (0, Polynomial::affine(DVec2::ZERO, DMat2::ZERO));
        let mut squares = sum(&best);
        // A similarity has four coefficients, an affine map has six.
        let coefficients = |degree: usize| if degree == 0 { 4.0 } else { ((degree + 1) * (degree + 2)) as f64 };
        for higher in (1..=MOST_DEGREE).take_while(|degree| ties.len() >= LENSLETS * (terms(*degree) + 1)) {
            let Some(fit) = Polynomial::about(&left, higher, DVec2::ZERO, radius_mm) else { break };
            let smaller = sum(&fit);
            let moved = left.iter().map(|tie| fit.at(tie.0).distance_squared(best.at(tie.0))).sum::<f64>();
            let more = coefficients(higher) - coefficients(degree);
            let gain = count * (squares / smaller.max(f64::MIN_POSITIVE)).ln();
            let is_worth = (moved / ties.len() as f64).sqrt() > WORTH_PX * px_mm;
            if is_worth && gain > EVIDENCE * more * count.ln() {
                (degree, best, squares) = (higher, fit, smaller);
            }
        }
        if degree == 0 {
            return Some(Self { perfect, centres: None, degree });
        }
        for _ in 0..GAUGE_STEPS {
            perfect.origin += best.coefficients[0];
            best = Polynomial::about(&departures(&perfect), degree, DVec2::ZERO, radius_mm)?;
        }
        let along = |axis: usize| best.coefficients[1..].iter().map(|pair| pair[axis]).collect();
        let centres = Centres { radius_mm, x_mm: along(0), y_mm: along(1) };
        Some(Self { perfect, centres: Some(centres), degree })
    }
}

/// The number of correlated residuals that count as one: the variance of the means of blocks of lenslets over that of
/// independent residuals, at least 1. Neighbours have similar errors where the lattice beats with the pixels.
fn correlation_factor(residuals: impl Iterator<Item = (DVec2, DVec2)> + Clone) -> f64 {
    let lenslets = residuals.clone().count() as f64;
    let side = BLOCK.min((lenslets.sqrt() / BLOCKS).floor()).max(1.0);
    let mut blocks = BTreeMap::new();
    let mut squares = 0.0;
    for (place, rest) in residuals {
        let [column, row] = (place / side).floor().to_array().map(|n| n as i64);
        let block: &mut (DVec2, f64) = blocks.entry((row, column)).or_default();
        block.0 += rest;
        block.1 += 1.0;
        squares += rest.length_squared();
    }
    // For independent residuals the variance of a block's sum grows in proportion to the number in it.
    let sums: f64 = blocks.values().map(|(sum, count)| sum.length_squared() / count).sum();
    (sums / blocks.len() as f64 / (squares / lenslets).max(f64::MIN_POSITIVE)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::uniform;
    use crate::white::basis::unit_basis;

    /// Centres of lenslets 1 mm apart, with a pixel of 0.01 mm. Each has a random error of `noise` mm.
    fn ties(side: i64, noise: f64, seed: u64, bent: impl Fn(DVec2) -> DVec2) -> Vec<TiePoint> {
        let mut state = seed;
        let mut random = || uniform(&mut state) - 0.5;
        let places = (-side..=side).flat_map(|j| (-side..=side).map(move |i| DVec2::new(i as f64, j as f64)));
        places
            .map(|place| {
                let scatter = DVec2::new(random() + random() + random(), random() + random() + random());
                let centre = unit_basis(true) * place + DVec2::new(0.3, -0.2);
                (place, centre + bent(centre) + 2.0 * noise * scatter)
            })
            .collect()
    }

    fn through(ties: &[TiePoint], radius: f64) -> DepartureFit {
        DepartureFit::through(ties, unit_basis(true), radius, 0.01).unwrap()
    }

    #[test]
    fn noise_on_a_perfect_lattice_never_bends_it() {
        for seed in 0..300 {
            for (side, noise) in [(3, 1e-3), (10, 1e-3), (10, 1e-6)] {
                assert_eq!(through(&ties(side, noise, seed, |_| DVec2::ZERO), 20.0).degree, 0, "{seed} {side}");
            }
        }
    }

    #[test]
    fn a_departure_below_the_noise_is_found_by_its_degree() {
        let shear = |c: DVec2| DVec2::new(0.0, 1e-4 * c.x);
        let keystone = |c: DVec2| 2e-5 * DVec2::new(c.x * c.x, c.x * c.y);
        let barrel = |c: DVec2| -2e-6 * c.length_squared() * c;
        let bends: [&dyn Fn(DVec2) -> DVec2; 3] = [&shear, &keystone, &barrel];
        for (n, bent) in bends.into_iter().enumerate() {
            let found = through(&ties(20, 1e-3, n as u64, bent), 30.0);
            assert_eq!(found.degree, n + 1);
            let centres = found.centres.unwrap();
            centres.check().unwrap();
            for place in [DVec2::new(-20.0, 20.0), DVec2::new(5.0, -7.0), DVec2::new(11.0, 13.0)] {
                let wanted = unit_basis(true) * place + DVec2::new(0.3, -0.2);
                let perfect = found.perfect.at(unit_basis(true) * place);
                let off = (perfect + centres.departure_mm(perfect)).distance(wanted + bent(wanted));
                assert!(off < 6e-4, "{n} {place}: {off}");
            }
        }
    }
}
