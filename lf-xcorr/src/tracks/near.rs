//! The pairs nearest to a place, and the displacement that they determine there.

use super::buckets::Buckets;
use super::matching::Pair;
use super::process::{Process, Scales, Sites};
use super::scales::{ScaleField, Usual};
use crate::vectors::Nodes;
use glam::{DMat3, DVec3};
use lf_core::statistics::{median, quantile};
use rayon::prelude::*;

/// Constant: number of pairs that determine a vector, and of pairs that determine the scales.
const PAIRS: usize = 24;
const PAIRS_OF_SCALES: usize = 30;
/// Constant: a pair is wrong beyond this squared Mahalanobis distance from the displacement that its neighbours give.
const WRONG: f64 = 25.0;
/// Constant: a pair is a suspect beyond this one.
const SUSPECT: f64 = 10.0;
/// Constant: quantiles between which pairs are counted for their density.
const INNER: [f64; 2] = [0.01, 0.99];

/// Pairs that give a vector at any place.
pub(crate) struct Near<'a> {
    pairs: &'a [Pair],
    /// Numbers of the pairs that are trusted, and their places.
    trusted: Vec<usize>,
    buckets: Buckets,
    usual: Usual,
}

impl<'a> Near<'a> {
    /// All pairs.
    pub fn new(pairs: &'a [Pair]) -> Self {
        let extent = DVec3::from_array([0, 1, 2].map(|axis| {
            let mut places: Vec<f64> = pairs.iter().map(|pair| pair.middle_mm[axis]).collect();
            let [low, high] = INNER.map(|share| quantile(&mut places, share));
            high - low
        }));
        let apart = (extent.max(DVec3::splat(f64::MIN_POSITIVE)).element_product() / pairs.len() as f64).cbrt();
        let uncertain = median(&mut pairs.iter().map(|pair| pair.covariance_mm2.x_axis.x.sqrt()).collect::<Vec<_>>());
        Self::of(pairs, (0..pairs.len()).collect(), Usual { apart: apart.max(uncertain), uncertain })
    }

    fn of(pairs: &'a [Pair], trusted: Vec<usize>, usual: Usual) -> Self {
        let buckets = Buckets::new(trusted.iter().map(|n| pairs[*n].middle_mm).collect());
        Self { pairs, trusted, buckets, usual }
    }

    /// The nearest pairs, the nearest first.
    fn nearest(&self, place_mm: DVec3, count: usize) -> Vec<usize> {
        let wanted = count.min(self.trusted.len());
        let mut half = 0.5 * self.usual.apart * (count as f64).cbrt();
        loop {
            let far = |n: usize| self.pairs[self.trusted[n]].middle_mm.distance(place_mm);
            let inside = self.buckets.near(place_mm, DVec3::splat(half)).map(|n| (far(n), self.trusted[n]));
            let mut found: Vec<(f64, usize)> = inside.filter(|(far, _)| *far <= half).collect();
            if found.len() >= wanted {
                found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                return found.into_iter().take(count).map(|(_, n)| n).collect();
            }
            half *= 1.5;
        }
    }

    fn sites(&self, numbers: &[usize]) -> Sites {
        let pairs = || numbers.iter().map(|n| &self.pairs[*n]);
        Sites {
            places: pairs().map(|pair| pair.middle_mm).collect(),
            shifts: pairs().map(|pair| pair.shift_mm).collect(),
            covariances: pairs().map(|pair| pair.covariance_mm2).collect(),
        }
    }

    /// The scales at nodes a window apart; `before` are those of more pairs.
    pub fn scales(&self, nodes: Nodes, before: Option<&ScaleField>) -> ScaleField {
        let near = |place: DVec3| self.nearest(place, PAIRS_OF_SCALES);
        ScaleField::new(nodes, self.usual, near, |pairs| self.sites(pairs), before)
    }

    /// The pairs that their neighbours do not contradict. A wrong pair makes the flow about it look rough, and then
    /// contradicts nothing: the scales about a suspect are those without it.
    pub fn without_wrong(self, scales: &ScaleField) -> Self {
        let is_right = |n: &usize| {
            let pair = &self.pairs[*n];
            let mut near = self.nearest(pair.middle_mm, PAIRS_OF_SCALES + 1);
            near.retain(|other| other != n);
            let distance2 = |scales: Scales| {
                let sites = self.sites(&near[..PAIRS.min(near.len())]);
                let process = Process::new(&sites, scales)?;
                let (shift, covariance) = process.at(pair.middle_mm);
                let rest = pair.shift_mm - shift;
                let total = covariance + scales.misfit * scales.misfit * pair.covariance_mm2;
                Some(rest.dot(total.inverse() * rest))
            };
            let is_below = |most: f64, scales| distance2(scales).is_none_or(|distance2| distance2 < most);
            is_below(SUSPECT, scales.at(pair.middle_mm))
                || is_below(WRONG, Scales::likeliest(&self.sites(&near), self.usual))
        };
        let trusted: Vec<usize> = self.trusted.par_iter().filter(|n| is_right(n)).copied().collect();
        Self::of(self.pairs, if trusted.is_empty() { self.trusted } else { trusted }, self.usual)
    }

    /// The displacement at a place, mm, and its covariance, mm²; None if rounding leaves none.
    pub fn vector(&self, place_mm: DVec3, scales: &ScaleField) -> Option<(DVec3, DMat3)> {
        let sites = self.sites(&self.nearest(place_mm, PAIRS));
        Process::new(&sites, scales.at(place_mm)).map(|process| process.at(place_mm))
    }

    /// Pairs that are not trusted.
    pub fn wrong(&self) -> usize {
        self.pairs.len() - self.trusted.len()
    }

    /// Trusted pairs in the window about a place.
    pub fn inside(&self, centre_mm: DVec3, half_mm: DVec3) -> usize {
        self.buckets.near(centre_mm, half_mm).count()
    }
}
