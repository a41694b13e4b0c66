//! A displacement between pairs: Gaussian process regression, which other fields call kriging or optimal interpolation.
//!
//! Model (Rasmussen & Williams 2006, chapter 2): the displacement is a constant plus a random field whose values at two
//! places correlate by Matern's function of order 9/2 of their distance. Order 5/2 takes smooth flows for rough ones
//! and states too much uncertainty; a Gaussian takes rough ones for smooth ones and states too little. Each component
//! has its own strength and length, because a turn in x, y does not say over what distance z changes. A pair measures
//! the displacement at its midpoint with the full covariance of both its places: near the focal plane a particle is
//! certain across a line and uncertain along it, and only the covariance knows the line. The vector at a place is the
//! mean of the field given the pairs; its covariance follows.

use glam::{DMat3, DVec3};
use lf_core::linear::{cholesky, dot, solve_lower};

/// Pairs that determine the displacement near them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sites {
    pub places: Vec<DVec3>,
    pub shifts: Vec<DVec3>,
    pub covariances: Vec<DMat3>,
}

/// How a flow changes from place to place, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scales {
    /// Distance over which each component changes.
    pub length: DVec3,
    /// Standard deviation of each component about the constant.
    pub strength: DVec3,
    /// Standard deviation of the pairs, relative to the one that their covariances state.
    pub misfit: f64,
}

/// The field given some pairs.
#[derive(Debug, Clone)]
pub(crate) struct Process<'a> {
    sites: &'a Sites,
    scales: Scales,
    /// Rows of the factor L of the covariance of all displacements.
    lower: Vec<f64>,
    /// `L^-1` times the displacements less the constant.
    rest: Vec<f64>,
    /// `L^-1` times the columns that add the constant.
    constants: [Vec<f64>; 3],
    constant: DVec3,
    /// Covariance of the constant.
    uncertain: DMat3,
}

/// Matern's function of order 9/2.
fn matern(distance: f64, length: f64) -> f64 {
    let s = 3.0 * distance / length;
    (1.0 + s * (1.0 + s * (3.0 / 7.0 + s * (2.0 / 21.0 + s / 105.0)))) * (-s).exp()
}

impl<'a> Process<'a> {
    /// None if rounding leaves no solution.
    pub fn new(sites: &'a Sites, scales: Scales) -> Option<Self> {
        let count = 3 * sites.places.len();
        let variance = scales.strength * scales.strength;
        let mut lower = vec![0.0; count * count];
        for (i, (place, own)) in sites.places.iter().zip(&sites.covariances).enumerate() {
            let own = (scales.misfit * scales.misfit * *own).to_cols_array_2d();
            for (j, other) in sites.places[..=i].iter().enumerate() {
                let distance = place.distance(*other);
                for c in 0..3 {
                    lower[(3 * i + c) * count + 3 * j + c] = matern(distance, scales.length[c]) * variance[c];
                }
            }
            for (c, row) in own.iter().enumerate() {
                let start = (3 * i + c) * count + 3 * i;
                lower[start..start + 3].iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
            }
        }
        cholesky(&mut lower, count, 0.0)?;
        let mut rest: Vec<f64> = sites.shifts.iter().flat_map(|shift| shift.to_array()).collect();
        solve_lower(&lower, &mut rest);
        let constants = [0, 1, 2].map(|c| {
            let mut column: Vec<f64> = (0..count).map(|n| if n % 3 == c { 1.0 } else { 0.0 }).collect();
            solve_lower(&lower, &mut column);
            column
        });
        let inverse = products(&constants, &constants);
        let uncertain = inverse.inverse();
        let constant = uncertain * DVec3::from_array(constants.each_ref().map(|column| dot(column, &rest)));
        for (c, column) in constants.iter().enumerate() {
            rest.iter_mut().zip(column).for_each(|(rest, value)| *rest -= constant[c] * value);
        }
        uncertain.is_finite().then_some(Self { sites, scales, lower, rest, constants, constant, uncertain })
    }

    /// Logarithm of the likelihood of the displacements, the constant being unknown, up to a number that depends on the
    /// count of pairs alone.
    pub fn log_likelihood(&self) -> f64 {
        let count = self.rest.len();
        let roots: f64 = self.lower.iter().step_by(count + 1).map(|root| root.ln()).sum();
        -0.5 * dot(&self.rest, &self.rest) - roots + 0.5 * self.uncertain.determinant().ln()
    }

    /// The displacement at a place, mm, and its covariance, mm².
    pub fn at(&self, place: DVec3) -> (DVec3, DMat3) {
        let count = self.rest.len();
        let variance = self.scales.strength * self.scales.strength;
        let distances: Vec<f64> = self.sites.places.iter().map(|site| site.distance(place)).collect();
        let columns = [0, 1, 2].map(|c| {
            let alike = |n: usize| matern(distances[n], self.scales.length[c]);
            let value = |n: usize| if n % 3 == c { alike(n / 3) * variance[c] } else { 0.0 };
            let mut column: Vec<f64> = (0..count).map(value).collect();
            solve_lower(&self.lower, &mut column);
            column
        });
        let known = DVec3::from_array(columns.each_ref().map(|column| dot(column, &self.rest)));
        let left = DMat3::IDENTITY - products(&self.constants, &columns);
        let about = DMat3::from_diagonal(variance) - products(&columns, &columns);
        (self.constant + known, about + left.transpose() * self.uncertain * left)
    }
}

/// Products of columns: row a and column b hold those of the `a`th of the first and the `b`th of the second.
fn products(first: &[Vec<f64>; 3], second: &[Vec<f64>; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&second.each_ref().map(|b| first.each_ref().map(|a| dot(a, b))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sites(pairs: &[(DVec3, DVec3, f64)]) -> Sites {
        Sites {
            places: pairs.iter().map(|pair| pair.0).collect(),
            shifts: pairs.iter().map(|pair| pair.1).collect(),
            covariances: pairs.iter().map(|pair| DMat3::from_diagonal(DVec3::splat(pair.2))).collect(),
        }
    }

    /// By hand: without strength, displacements 0 and 6 with variances 1 and 2 (times 1e-6) have the mean 2 and the
    /// variance 2 / 3.
    #[test]
    fn two_pairs_by_hand() {
        let sites = sites(&[(DVec3::ZERO, DVec3::ZERO, 1e-6), (DVec3::X, 6e-3 * DVec3::X, 2e-6)]);
        let process =
            Process::new(&sites, Scales { length: DVec3::ONE, strength: DVec3::splat(1e-12), misfit: 1.0 }).unwrap();
        let (shift, covariance) = process.at(DVec3::new(0.3, 0.2, 0.1));
        assert!((shift - 2e-3 * DVec3::X).abs().max_element() < 1e-9, "{shift}");
        assert!((covariance.diagonal() - 2e-6 / 3.0).abs().max_element() < 1e-12, "{covariance}");
    }

    /// Exact pairs are met, and far from all of them the field is the constant with its own strength.
    #[test]
    fn exact_pairs_are_met_and_far_ones_do_not_count() {
        let wave = |place: DVec3| DVec3::new((2.0 * place.x).sin(), place.y, 0.5);
        let places: Vec<DVec3> =
            (0..27).map(|n| 0.4 * DVec3::new((n % 3) as f64, (n / 3 % 3) as f64, (n / 9) as f64)).collect();
        let sites = sites(&places.iter().map(|place| (*place, wave(*place), 1e-10)).collect::<Vec<_>>());
        let process = Process::new(&sites, Scales { length: DVec3::ONE, strength: DVec3::ONE, misfit: 1.0 }).unwrap();
        assert!((process.at(places[13]).0 - wave(places[13])).abs().max_element() < 1e-4);
        let between = DVec3::new(0.55, 0.3, 0.2);
        assert!((process.at(between).0 - wave(between)).abs().max_element() < 0.02, "{}", process.at(between).0);
        assert!(process.at(DVec3::splat(50.0)).1.diagonal().min_element() > 1.0);
    }

    /// Each of two particles is certain across its own line only. Together they determine the whole displacement.
    #[test]
    fn lines_that_cross_give_a_point() {
        let wanted = DVec3::new(1e-3, 2e-3, -5e-3);
        let mut all = Sites::default();
        for direction in [DVec3::new(0.3, 0.0, 1.0), DVec3::new(-0.2, 0.0, 1.0)] {
            let along = direction.normalize();
            let outer = DMat3::from_cols(along * along.x, along * along.y, along * along.z);
            all.places.push(direction);
            all.shifts.push(wanted + 0.08 * along);
            all.covariances.push(DMat3::from_diagonal(DVec3::splat(1e-10)) + 0.01 * outer);
        }
        let process =
            Process::new(&all, Scales { length: DVec3::ONE, strength: DVec3::splat(1e-9), misfit: 1.0 }).unwrap();
        let (shift, covariance) = process.at(DVec3::ZERO);
        assert!((shift - wanted).length() < 3e-4, "{shift}");
        assert!(covariance.diagonal().max_element() < 1e-8);
    }

    #[test]
    fn the_likelihood_knows_the_strength() {
        let places: Vec<DVec3> = (0..12).map(|n| DVec3::new(0.7 * n as f64, (n * n % 5) as f64, 0.0)).collect();
        let turn = |n: usize| 1e-2 * DVec3::new((n as f64 * 2.4).sin(), (n as f64 * 1.7).cos(), 0.0);
        let pairs: Vec<_> = places.iter().enumerate().map(|(n, place)| (*place, turn(n), 1e-10)).collect();
        let sites = sites(&pairs);
        let of = |strength: f64| {
            let scales =
                Scales { length: DVec3::splat(0.5), strength: DVec3::new(strength, strength, 1e-9), misfit: 1.0 };
            Process::new(&sites, scales).unwrap().log_likelihood()
        };
        assert!(of(7e-3) > of(7e-4) && of(7e-3) > of(7e-2));
    }
}
