//! The pairs around every window, and the fits of all windows.

use super::{buckets::Buckets, guess::Guess, matching::Pair, window_fit::*};
use crate::vectors::Nodes;
use glam::{DMat3, DVec3};

/// Pairs, windows, and the displacement that the fits start from.
pub(crate) struct Fitter<'a> {
    pub pairs: &'a [Pair],
    pub nodes: Nodes,
    /// Half a window, mm.
    pub half_mm: DVec3,
    /// Displacement of each pair less the guess, mm.
    pub rest_mm: Vec<DVec3>,
    buckets: Buckets,
}

impl<'a> Fitter<'a> {
    /// Without a guess the fits start from no motion.
    pub fn new(pairs: &'a [Pair], nodes: Nodes, half_mm: DVec3, guess: Option<&Guess>) -> Self {
        let rest = |pair: &Pair| pair.shift_mm - guess.map_or(DVec3::ZERO, |guess| guess.shift_mm(pair.middle_mm));
        let buckets = Buckets::new(pairs.iter().map(|pair| pair.middle_mm).collect());
        Self { rest_mm: pairs.iter().map(rest).collect(), pairs, nodes, half_mm, buckets }
    }

    /// The pairs in the window about a place.
    pub fn samples(&self, centre_mm: DVec3) -> Vec<Sample> {
        let sample = |n: usize| {
            let Pair { middle_mm, covariance_mm2, chance, .. } = self.pairs[n];
            let basis = basis((middle_mm - centre_mm) / self.half_mm);
            Sample { basis, rest_mm: self.rest_mm[n], covariance_mm2, chance }
        };
        self.buckets.near(centre_mm, self.half_mm).map(sample).collect()
    }

    /// The vector of the window about a place, less the guess; None without a pair that counts. `misfit` scales its
    /// covariance.
    pub fn fit(&self, centre_mm: DVec3, priors: &Priors, misfit: f64) -> Option<Fitted> {
        let fit = WindowFit::new(&self.samples(centre_mm), priors)?;
        let pairs = fit.weights.iter().filter(|weight| **weight > 0.5).count();
        let covariance_mm2 = misfit * fit.covariance_mm2();
        (pairs > 0).then(|| Fitted { shift_mm: fit.terms[0], covariance_mm2, pairs })
    }

    /// Minimum variance; below it rounding dominates, mm².
    pub fn minimum_mm2(&self) -> f64 {
        1e-12 * self.half_mm.max_element().powi(2)
    }
}

/// The vector of a window by its pairs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fitted {
    pub shift_mm: DVec3,
    pub covariance_mm2: DMat3,
    /// Pairs that count.
    pub pairs: usize,
}
