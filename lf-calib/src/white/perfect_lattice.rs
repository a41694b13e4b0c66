//! The perfect lattice through measured centres: the best similarity (origin, rotation, pitch).

use crate::fit::polynomial::TiePoint;
use glam::{DMat2, DVec2};

/// A perfect lattice: position = origin + turn(q), where q is the position in the unit lattice.
pub(crate) struct PerfectLattice {
    /// Centre of lenslet (0, 0), in the unit of the tie points: px or mm.
    pub origin: DVec2,
    /// Pitch times (cos, sin) of the rotation, in the same unit.
    pub turn: DVec2,
    /// Standard deviation of one coordinate of a centre about the lattice.
    deviation: f64,
    middle: DVec2,
    spread: f64,
    count: f64,
}

impl PerfectLattice {
    /// Fits by least squares, (x, y) as complex numbers. `unit` holds the lattice vectors in pitches. None without a
    /// pitch.
    pub fn through(ties: &[TiePoint], unit: DMat2) -> Option<Self> {
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
        let origin = mean - turn.rotate(middle);
        let mut fit = Self { origin, turn, deviation: 0.0, middle, spread, count };
        let squares: f64 = ties.iter().map(|tie| (tie.1 - fit.at(unit * tie.0)).length_squared()).sum();
        fit.deviation = (squares / (2.0 * count - 4.0)).sqrt();
        (turn.length() > 0.0 && turn.is_finite()).then_some(fit)
    }

    pub fn at(&self, q: DVec2) -> DVec2 {
        self.origin + self.turn.rotate(q)
    }

    /// Standard uncertainty of the pitch. Divided by the pitch, it is that of the rotation in rad.
    pub fn pitch_uncertainty(&self) -> f64 {
        self.deviation / self.spread.sqrt()
    }

    /// Standard uncertainty of each coordinate of the lattice at a point of the unit lattice.
    pub fn place_uncertainty(&self, q: DVec2) -> f64 {
        self.deviation * (1.0 / self.count + q.distance_squared(self.middle) / self.spread).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::robust::without_outliers;
    use crate::white::basis::unit_basis;

    #[test]
    fn a_perfect_lattice_is_returned_and_outliers_are_dropped() {
        for hexagonal in [false, true] {
            let turn = 14.0 * DVec2::from_angle(0.2);
            let unit = unit_basis(hexagonal);
            let places = (0..400).map(|n| DVec2::new((n % 20) as f64, (n / 20) as f64));
            let mut ties: Vec<TiePoint> =
                places.map(|place| (place, DVec2::new(3.0, -2.0) + turn.rotate(unit * place))).collect();
            for n in (0..400).step_by(7) {
                ties[n].1 += DVec2::new(4.0, 1.0);
            }
            let fit = |ties: &[TiePoint]| PerfectLattice::through(ties, unit);
            let (found, kept) =
                without_outliers(&ties, &vec![1.0; ties.len()], fit, |fit, place| fit.at(unit * place)).unwrap();
            assert!(found.turn.distance(turn) < 1e-12 && found.origin.distance(DVec2::new(3.0, -2.0)) < 1e-10);
            assert_eq!(kept.iter().filter(|kept| !**kept).count(), 58);
        }
    }
}
