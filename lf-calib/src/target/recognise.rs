//! Finds out which peak of light is which dot of a target.

use crate::fit::polynomial::{Polynomial, TiePoint};
use glam::{DMat2, DVec2};
use lf_core::{Refusal, statistics::upper_median};
use std::fmt::Display;

/// Largest distance between a dot and its peak, in spacings of the dots.
const NEAR: f64 = 0.3;
/// Largest scatter of the dots about the target's own grid, in spacings. Random matches have 0.2.
const LARGEST_SCATTER: f64 = 0.1;
/// Largest stretch or rotation of the target against the stated one.
const LARGEST_STRETCH: f64 = 0.12;
/// Smallest number of dots that make a target.
const FEWEST: usize = 9;
/// Smallest number of pairs that determines an affine map.
const FEWEST_AFFINE: usize = 6;
/// Smallest share of the dots in view that must be found.
const LEAST_SEEN: f64 = 0.5;
/// Number of peaks about the middle that a first shift is tried on.
const FIRST: usize = 25;

#[derive(Debug)]
pub(crate) struct Recognised {
    /// Numbers of dots and the positions of their peaks, mm.
    pub pairs: Vec<(usize, DVec2)>,
    /// Position of the peaks minus that of the dots, in the middle of the target, mm.
    pub shift_mm: DVec2,
}

/// The affine map from dots to their peaks by least squares. Few pairs, or pairs in a row, give only a shift.
fn affine(pairs: &[TiePoint]) -> Polynomial {
    let shift = || pairs.iter().map(|(dot, peak)| *peak - *dot).sum::<DVec2>() / pairs.len() as f64;
    let whole = (pairs.len() >= FEWEST_AFFINE).then(|| Polynomial::through(pairs, 1)).flatten();
    whole.unwrap_or_else(|| Polynomial::affine(shift(), DMat2::IDENTITY))
}

pub(crate) fn no_target(found: impl Display) -> Refusal {
    Refusal::new(format!("no target: {found}"), "wanted bright dots on a dark ground, where the target has them")
}

fn nearest(places: &[DVec2], to: DVec2) -> Option<(usize, f64)> {
    let distances = places.iter().map(|place| place.distance_squared(to)).enumerate();
    distances.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(n, square)| (n, square.sqrt()))
}

/// Distance from a dot to its neighbour: the median over the dots. None with fewer than two dots.
pub(crate) fn spacing_mm(dots: &[DVec2]) -> Option<f64> {
    let every = (dots.len() / 200).max(1);
    let mut distances: Vec<f64> = (0..dots.len())
        .step_by(every)
        .filter_map(|n| {
            let others = dots.iter().enumerate().filter(|(m, _)| *m != n);
            others.map(|(_, other)| other.distance(dots[n])).min_by(f64::total_cmp)
        })
        .collect();
    upper_median(&mut distances).filter(|median| *median > 0.0)
}

/// Finds the dots of a target among peaks of light, from the middle outwards. The target may be shifted by up to half a
/// spacing from its stated position (or from `shift_mm` if another depth has shown it), and stretched and turned a
/// little. Dots beyond `view_mm` need not be seen. Refuses peaks that are not the target.
pub(crate) fn recognise(
    dots: &[DVec2],
    peaks: &[DVec2],
    view_mm: DVec2,
    shift_mm: Option<DVec2>,
) -> Result<Recognised, Refusal> {
    let expected = dots.iter().filter(|dot| dot.abs().cmple(view_mm).all()).count();
    let few = |found: usize| no_target(format!("{found} of the {expected} dots in view"));
    let (Some(spacing), true) = (spacing_mm(dots), peaks.len() >= FEWEST) else { return Err(few(0)) };
    let mut inner: Vec<DVec2> = peaks.to_vec();
    inner.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    inner.truncate(FIRST);
    let shift = shift_mm.unwrap_or_else(|| first_shift(dots, &inner, spacing));
    let mut map = Polynomial::affine(shift, DMat2::IDENTITY);
    let middle = inner[0] - shift;
    let farthest = dots.iter().map(|dot| dot.distance(middle)).fold(0.0, f64::max);
    let mut radius = 1.6 * spacing;
    let mut pairs: Vec<(usize, usize, f64)> = Vec::new();
    loop {
        // Twice at each radius: a better map gives better pairs.
        for _ in 0..2 {
            pairs = pair(dots, peaks, &map, middle, radius, NEAR * spacing);
            if pairs.len() >= 3 {
                let places: Vec<TiePoint> = pairs.iter().map(|&(dot, peak, _)| (dots[dot], peaks[peak])).collect();
                map = affine(&places);
            }
        }
        if radius > farthest {
            break;
        }
        radius *= 1.5;
    }
    let stretch = map.basis_at(middle) - DMat2::IDENTITY;
    let strained = stretch.x_axis.abs().max_element().max(stretch.y_axis.abs().max_element());
    let scatter = (pairs.iter().map(|pair| pair.2 * pair.2).sum::<f64>() / pairs.len().max(1) as f64).sqrt();
    let is_regular = scatter <= LARGEST_SCATTER * spacing && strained <= LARGEST_STRETCH;
    if !is_regular {
        return Err(few(0));
    }
    if pairs.len() < FEWEST || (pairs.len() as f64) < LEAST_SEEN * expected as f64 {
        return Err(few(pairs.len()));
    }
    let shift_mm = map.at(DVec2::ZERO);
    Ok(Recognised { pairs: pairs.into_iter().map(|(dot, peak, _)| (dot, peaks[peak])).collect(), shift_mm })
}

/// The shift that brings most of the inner peaks to dots; among equals the shortest.
fn first_shift(dots: &[DVec2], inner: &[DVec2], spacing: f64) -> DVec2 {
    let start = inner[0];
    let near = dots.iter().filter(|dot| dot.distance(start) <= 0.75 * spacing);
    let score = |shift: DVec2| {
        let hits = inner.iter().filter_map(|peak| nearest(dots, *peak - shift)).filter(|(_, far)| *far < 0.2 * spacing);
        hits.count()
    };
    let mut candidates: Vec<(usize, f64, DVec2)> =
        near.map(|dot| start - *dot).map(|shift| (score(shift), shift.length(), shift)).collect();
    candidates.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)));
    candidates.first().map_or(DVec2::ZERO, |candidate| candidate.2)
}

/// Dots within `radius` of the middle and peaks that are each other's nearest, with the distance that the map leaves.
fn pair(
    dots: &[DVec2],
    peaks: &[DVec2],
    map: &Polynomial,
    middle: DVec2,
    radius: f64,
    near: f64,
) -> Vec<(usize, usize, f64)> {
    let mut found: Vec<(usize, usize, f64)> = dots
        .iter()
        .enumerate()
        .filter(|(_, dot)| dot.distance(middle) <= radius)
        .filter_map(|(n, dot)| {
            let (peak, far) = nearest(peaks, map.at(*dot))?;
            (far <= near).then_some((n, peak, far))
        })
        .collect();
    found.sort_by(|a, b| a.1.cmp(&b.1).then(a.2.total_cmp(&b.2)));
    found.dedup_by_key(|pair| pair.1);
    found.sort_by_key(|pair| pair.0);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::uniform;

    fn grid() -> Vec<DVec2> {
        (0..81).map(|n| DVec2::new((n % 9) as f64 - 4.0, (n / 9) as f64 - 4.0) * 1.1).collect()
    }

    #[test]
    fn a_grid_shifted_stretched_turned_and_torn_is_recognised() {
        let (turn, shift) = (DMat2::from_angle(0.03) * 1.04, DVec2::new(0.41, -0.3));
        let mut state = 3;
        let mut peaks: Vec<DVec2> = grid()
            .iter()
            .enumerate()
            .filter(|(n, _)| n % 7 != 3)
            .map(|(_, dot)| turn * *dot + shift + 0.02 * DVec2::new(uniform(&mut state), uniform(&mut state)))
            .collect();
        peaks.extend((0..8).map(|_| 9.0 * DVec2::new(uniform(&mut state) - 0.5, uniform(&mut state) - 0.5)));
        let found = recognise(&grid(), &peaks, DVec2::splat(4.5), None).unwrap();
        assert!(found.pairs.len() >= 68, "{}", found.pairs.len());
        let wrong = found.pairs.iter().filter(|(n, place)| place.distance(turn * grid()[*n] + shift) > 0.1).count();
        assert!(wrong <= 2, "{wrong}");
        assert!(found.shift_mm.distance(shift) < 0.05);
    }

    #[test]
    fn random_peaks_are_no_target() {
        let mut state = 11;
        for count in [0, 5, 40, 81, 300] {
            let peaks: Vec<DVec2> =
                (0..count).map(|_| 9.4 * DVec2::new(uniform(&mut state) - 0.5, uniform(&mut state) - 0.5)).collect();
            let refused = recognise(&grid(), &peaks, DVec2::splat(4.5), None).unwrap_err();
            assert!(refused.found.ends_with("of the 81 dots in view"), "{count}: {refused}");
        }
    }
}
