//! Least squares of a lattice through measured centres, deaf to outliers.

use glam::{DMat2, DVec2};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A place in the lattice (in basis vectors) and the centre measured there, px.
pub(crate) type Tie = (DVec2, DVec2);

/// Tukey's reach: residuals beyond this many standard deviations (from the median distance) are outliers.
const OUTLIER: f64 = 4.5;
/// The median distance of a two-dimensional normal scatter, in standard deviations of a coordinate: sqrt(2 ln 2).
const MEDIAN_DISTANCE: f64 = 1.177_410_022_515_474_7;
/// Residuals below this are never outliers, px: rounding is no evidence.
const LEAST_OUTLIER_PX: f64 = 1e-4;

/// Image place from lattice place: a polynomial in both lattice coordinates.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Warp {
    order: usize,
    middle: DVec2,
    scale: f64,
    /// One coefficient pair a monomial, as [`monomials`] lists them.
    coefficients: Vec<DVec2>,
}

/// The highest order of a warp, and its terms.
const MOST_ORDER: usize = 5;
const MOST_TERMS: usize = (MOST_ORDER + 1) * (MOST_ORDER + 2) / 2;

/// x^a y^b with a + b up to `order`, lowest order first; what is behind them is 0.
fn monomials(order: usize, place: DVec2) -> [f64; MOST_TERMS] {
    let (mut x, mut y) = ([1.0; MOST_ORDER + 1], [1.0; MOST_ORDER + 1]);
    for n in 1..=order {
        x[n] = x[n - 1] * place.x;
        y[n] = y[n - 1] * place.y;
    }
    let (mut terms, mut count) = ([0.0; MOST_TERMS], 0);
    for degree in 0..=order {
        for b in 0..=degree {
            terms[count] = x[degree - b] * y[b];
            count += 1;
        }
    }
    terms
}

/// Parts of the ties that are summed apart and added in order: the sum is the same for any number of threads.
const PARTS: usize = 8;

impl Warp {
    /// The perfect lattice through an origin.
    pub fn affine(origin_px: DVec2, basis_px: DMat2) -> Self {
        let coefficients = vec![origin_px, basis_px.x_axis, basis_px.y_axis];
        Self { order: 1, middle: DVec2::ZERO, scale: 1.0, coefficients }
    }

    /// Where the lenslet at a place of the lattice is imaged, px.
    pub fn at(&self, place: DVec2) -> DVec2 {
        let place = (place - self.middle) / self.scale;
        monomials(self.order, place)
            .iter()
            .zip(&self.coefficients)
            .map(|(term, &coefficient)| *term * coefficient)
            .sum()
    }

    /// The lattice vectors around a place, px.
    pub fn basis_at(&self, place: DVec2) -> DMat2 {
        let step = |axis: DVec2| 0.5 * (self.at(place + axis) - self.at(place - axis));
        DMat2::from_cols(step(DVec2::X), step(DVec2::Y))
    }

    /// One coefficient pair a monomial of the place less the middle over the scale, lowest degree first.
    pub fn coefficients(&self) -> &[DVec2] {
        &self.coefficients
    }

    /// Least squares through ties; none if they do not span the plane.
    pub fn through(ties: &[Tie], order: usize) -> Option<Self> {
        let middle = ties.iter().map(|tie| tie.0).sum::<DVec2>() / ties.len() as f64;
        let scale = ties.iter().map(|tie| tie.0.distance(middle)).fold(0.0, f64::max);
        Self::about(ties, order, middle, scale)
    }

    /// Least squares in places less a middle over a scale; none if the ties do not span the plane.
    pub fn about(ties: &[Tie], order: usize, middle: DVec2, scale: f64) -> Option<Self> {
        let terms = (order + 1) * (order + 2) / 2;
        if ties.len() < terms {
            return None;
        }
        let empty = || (DMatrix::<f64>::zeros(terms, terms), [0, 1].map(|_| DVector::<f64>::zeros(terms)));
        let part = |ties: &[Tie]| {
            let (mut normal, mut right) = empty();
            for (place, centre) in ties {
                let line = monomials(order, (*place - middle) / scale);
                for a in 0..terms {
                    for b in 0..=a {
                        normal[(a, b)] += line[a] * line[b];
                    }
                    right[0][a] += line[a] * centre.x;
                    right[1][a] += line[a] * centre.y;
                }
            }
            (normal, right)
        };
        let parts: Vec<_> = ties.par_chunks(ties.len().div_ceil(PARTS)).map(part).collect();
        let (mut normal, mut right) = empty();
        for (part_normal, part_right) in parts {
            normal += part_normal;
            right.iter_mut().zip(part_right).for_each(|(sum, part)| *sum += part);
        }
        let solver = normal.cholesky()?;
        // A nearly empty direction (one row of lenslets) passes Cholesky and means nothing.
        let pivots = solver.l_dirty().diagonal();
        if pivots.min() < 1e-6 * pivots.max() {
            return None;
        }
        let [x, y] = right.map(|right| solver.solve(&right));
        let coefficients = (0..terms).map(|term| DVec2::new(x[term], y[term])).collect();
        Some(Self { order, middle, scale, coefficients })
    }
}

/// The lattice vectors of a layout in pitches, columns.
pub(crate) fn unit_basis(hexagonal: bool) -> DMat2 {
    if hexagonal { DMat2::from_cols(DVec2::X, DVec2::new(0.5, 0.75f64.sqrt())) } else { DMat2::IDENTITY }
}

/// A perfect lattice through measured centres: place = origin + turn(q), q the unit lattice's place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Similarity {
    /// Where the lenslet (0, 0) is imaged, px.
    pub origin_px: DVec2,
    /// Pitch times (cos, sin) of the rotation, px.
    pub turn_px: DVec2,
    /// Standard deviation of a coordinate of a centre about the lattice, px.
    pub deviation_px: f64,
    middle: DVec2,
    spread: f64,
    count: f64,
}

impl Similarity {
    /// Least squares in closed form, (x, y) as complex numbers.
    pub fn through(ties: &[Tie], unit: DMat2) -> Option<Self> {
        let count = ties.len() as f64;
        if ties.len() < 3 {
            return None;
        }
        let middle = unit * (ties.iter().map(|tie| tie.0).sum::<DVec2>() / count);
        let mean = ties.iter().map(|tie| tie.1).sum::<DVec2>() / count;
        let (mut turn, mut spread) = (DVec2::ZERO, 0.0);
        for (place, centre) in ties {
            let (q, x) = (unit * *place - middle, *centre - mean);
            turn += DVec2::new(q.x, -q.y).rotate(x);
            spread += q.length_squared();
        }
        turn /= spread;
        let origin_px = mean - turn.rotate(middle);
        let mut fit = Self { origin_px, turn_px: turn, deviation_px: 0.0, middle, spread, count };
        let squares: f64 = ties.iter().map(|tie| (tie.1 - fit.at(unit * tie.0)).length_squared()).sum();
        fit.deviation_px = (squares / (2.0 * count - 4.0)).sqrt();
        (turn.length() > 0.0 && turn.is_finite()).then_some(fit)
    }

    /// Image place of a place of the unit lattice, px.
    pub fn at(&self, q: DVec2) -> DVec2 {
        self.origin_px + self.turn_px.rotate(q)
    }

    /// Standard uncertainty of the pitch, px; over the pitch, that of the rotation, rad.
    pub fn pitch_uncertainty_px(&self) -> f64 {
        self.deviation_px / self.spread.sqrt()
    }

    /// Standard uncertainty of each coordinate of the lattice at a place of the unit lattice, px.
    pub fn place_uncertainty_px(&self, q: DVec2) -> f64 {
        self.deviation_px * (1.0 / self.count + q.distance_squared(self.middle) / self.spread).sqrt()
    }
}

/// Repeats a fit without its outliers until none is left to drop; also which ties were kept. Each tie's distance counts
/// over its spread, whose unit does not matter.
pub(crate) fn without_outliers<F>(
    ties: &[Tie],
    spreads: &[f64],
    fit: impl Fn(&[Tie]) -> Option<F>,
    at: impl Fn(&F, DVec2) -> DVec2 + Sync,
) -> Option<(F, Vec<bool>)> {
    let mut kept = vec![true; ties.len()];
    let mut found = fit(ties)?;
    for _ in 0..20 {
        let off = |tie: &Tie| at(&found, tie.0).distance(tie.1);
        let distances: Vec<f64> = ties.iter().zip(spreads).map(|(tie, spread)| off(tie) / spread).collect();
        let mut sorted = distances.clone();
        let half = sorted.len() / 2;
        let (_, &mut median, _) = sorted.select_nth_unstable_by(half, f64::total_cmp);
        let limit = OUTLIER * median / MEDIAN_DISTANCE;
        let is_near = |(distance, spread): (&f64, &f64)| *distance <= limit.max(LEAST_OUTLIER_PX / spread);
        let next: Vec<bool> = distances.iter().zip(spreads).map(is_near).collect();
        if next == kept {
            break;
        }
        kept = next;
        let rest: Vec<Tie> = ties.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(tie, _)| *tie).collect();
        found = fit(&rest)?;
    }
    Some((found, kept))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ties(turn: DVec2, unit: DMat2) -> Vec<Tie> {
        (0..400)
            .map(|n| DVec2::new((n % 20) as f64, (n / 20) as f64))
            .map(|place| (place, DVec2::new(3.0, -2.0) + turn.rotate(unit * place)))
            .collect()
    }

    #[test]
    fn a_perfect_lattice_is_returned_and_outliers_are_dropped() {
        for hexagonal in [false, true] {
            let turn = 14.0 * DVec2::from_angle(0.2);
            let unit = unit_basis(hexagonal);
            let mut ties = ties(turn, unit);
            for n in (0..400).step_by(7) {
                ties[n].1 += DVec2::new(4.0, 1.0);
            }
            let fit = |ties: &[Tie]| Similarity::through(ties, unit);
            let (found, kept) =
                without_outliers(&ties, &vec![1.0; ties.len()], fit, |fit, place| fit.at(unit * place)).unwrap();
            assert!(found.turn_px.distance(turn) < 1e-12 && found.origin_px.distance(DVec2::new(3.0, -2.0)) < 1e-10);
            assert_eq!(kept.iter().filter(|kept| !**kept).count(), 58);
        }
    }

    #[test]
    fn a_polynomial_is_returned_and_a_single_row_is_refused() {
        let bent = |p: DVec2| DVec2::new(1.0 + 14.0 * p.x + 0.01 * p.x * p.y, 2.0 + 14.0 * p.y - 1e-4 * p.y.powi(3));
        let ties: Vec<Tie> = ties(DVec2::X, DMat2::IDENTITY).iter().map(|tie| (tie.0, bent(tie.0))).collect();
        let warp = Warp::through(&ties, 3).unwrap();
        assert!(warp.at(DVec2::new(4.5, 8.25)).distance(bent(DVec2::new(4.5, 8.25))) < 1e-9);
        assert!(Warp::through(&ties[..20], 1).is_none());
    }
}
