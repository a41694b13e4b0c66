//! Smooth maps of the plane: polynomials in two coordinates, fitted by least squares.

use glam::{DMat2, DVec2};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A position, often in lattice vectors, and the position that is measured for it, often in px.
pub(crate) type TiePoint = (DVec2, DVec2);

/// Highest degree, and its number of monomials.
const MOST_DEGREE: usize = 5;
const MOST_TERMS: usize = (MOST_DEGREE + 1) * (MOST_DEGREE + 2) / 2;
/// The tie points are summed in this many parts, added in order: the sum is the same for any number of threads.
const PARTS: usize = 8;

/// A polynomial from positions to positions.
#[derive(Clone)]
pub(crate) struct Polynomial {
    degree: usize,
    middle: DVec2,
    scale: f64,
    /// One pair for each monomial of (place - middle) / scale, in the order of [`monomials`].
    pub coefficients: Vec<DVec2>,
}

/// x^a y^b with a + b up to `degree`, lowest degree first; the rest is 0.
fn monomials(degree: usize, place: DVec2) -> [f64; MOST_TERMS] {
    let (mut x, mut y) = ([1.0; MOST_DEGREE + 1], [1.0; MOST_DEGREE + 1]);
    for n in 1..=degree {
        x[n] = x[n - 1] * place.x;
        y[n] = y[n - 1] * place.y;
    }
    let (mut terms, mut count) = ([0.0; MOST_TERMS], 0);
    for sum in 0..=degree {
        for b in 0..=sum {
            terms[count] = x[sum - b] * y[b];
            count += 1;
        }
    }
    terms
}

/// The outer product a b'.
pub(crate) fn outer(a: DVec2, b: DVec2) -> DMat2 {
    DMat2::from_cols(a * b.x, a * b.y)
}

/// The middle of an image of shape (height, width), px from its left and top edge.
pub(crate) fn middle_px((height, width): (usize, usize)) -> DVec2 {
    0.5 * DVec2::new(width as f64, height as f64)
}

impl Polynomial {
    /// The affine map of a perfect lattice: origin and lattice vectors, px.
    pub fn affine(origin_px: DVec2, basis_px: DMat2) -> Self {
        let coefficients = vec![origin_px, basis_px.x_axis, basis_px.y_axis];
        Self { degree: 1, middle: DVec2::ZERO, scale: 1.0, coefficients }
    }

    pub fn at(&self, place: DVec2) -> DVec2 {
        let place = (place - self.middle) / self.scale;
        monomials(self.degree, place)
            .iter()
            .zip(&self.coefficients)
            .map(|(term, &coefficient)| *term * coefficient)
            .sum()
    }

    /// The lattice vectors around a place: the steps of the map for a unit step along each axis.
    pub fn basis_at(&self, place: DVec2) -> DMat2 {
        let step = |axis: DVec2| 0.5 * (self.at(place + axis) - self.at(place - axis));
        DMat2::from_cols(step(DVec2::X), step(DVec2::Y))
    }

    /// Fits by least squares about the tie points' mean, scaled by their reach. None if they do not span the plane.
    pub fn through(ties: &[TiePoint], degree: usize) -> Option<Self> {
        let middle = ties.iter().map(|tie| tie.0).sum::<DVec2>() / ties.len() as f64;
        let scale = ties.iter().map(|tie| tie.0.distance(middle)).fold(0.0, f64::max);
        Self::about(ties, degree, middle, scale)
    }

    /// Fits by least squares in (place - middle) / scale. None if the tie points do not span the plane.
    pub fn about(ties: &[TiePoint], degree: usize, middle: DVec2, scale: f64) -> Option<Self> {
        let terms = (degree + 1) * (degree + 2) / 2;
        if ties.len() < terms {
            return None;
        }
        let empty = || (DMatrix::<f64>::zeros(terms, terms), [0, 1].map(|_| DVector::<f64>::zeros(terms)));
        let part = |ties: &[TiePoint]| {
            let (mut normal, mut right) = empty();
            for (place, centre) in ties {
                let line = monomials(degree, (*place - middle) / scale);
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
        // Cholesky accepts a nearly empty direction, for example one row of lenslets, but its solution means nothing.
        let pivots = solver.l_dirty().diagonal();
        if pivots.min() < 1e-6 * pivots.max() {
            return None;
        }
        let [x, y] = right.map(|right| solver.solve(&right));
        let coefficients = (0..terms).map(|term| DVec2::new(x[term], y[term])).collect();
        Some(Self { degree, middle, scale, coefficients })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_returned_and_a_single_row_is_refused() {
        let bent = |p: DVec2| DVec2::new(1.0 + 14.0 * p.x + 0.01 * p.x * p.y, 2.0 + 14.0 * p.y - 1e-4 * p.y.powi(3));
        let places = (0..400).map(|n| DVec2::new((n % 20) as f64, (n / 20) as f64));
        let ties: Vec<TiePoint> = places.map(|place| (place, bent(place))).collect();
        let fit = Polynomial::through(&ties, 3).unwrap();
        assert!(fit.at(DVec2::new(4.5, 8.25)).distance(bent(DVec2::new(4.5, 8.25))) < 1e-9);
        assert!(Polynomial::through(&ties[..20], 1).is_none());
    }
}
