//! The choice between direct sums and transforms.

use super::options::Route;
use super::prepared::{PreparedPass, Volumes};
use crate::correlate::{Estimate, shared_sums};

/// Why products are summed as they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The options ask for it.
    Asked,
    /// The search is close about known vectors, where transforms gain nothing.
    Close,
    /// It is estimated to be faster.
    Faster,
    /// Direct sums would take too much memory.
    Memory,
}

/// How the products of a pass are summed, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// By transforms; directly if false.
    pub is_transform: bool,
    /// The reason.
    pub reason: Reason,
    /// Estimated time by direct sums on one core, seconds.
    pub direct_s: f64,
    /// Estimated time by transforms on one core, seconds.
    pub transform_s: f64,
}

/// Constant: radius of a search about a displacement that is known to one voxel, bins: one for its error, one for the
/// fit.
pub(crate) const CLOSE: [usize; 3] = [2, 2, 2];

impl Choice {
    /// The choice for a pass over `volumes`; the search is close if the vectors are known.
    pub(crate) fn new(pass: &PreparedPass, volumes: &Volumes, route: Route, is_close: bool) -> Self {
        let search = pass.binned.pass.search;
        let radius = if is_close { CLOSE } else { search };
        let (mut direct_s, mut transform_s) = (0.0, 0.0);
        for pair in &volumes.pairs {
            let estimate = Estimate::new(*pair, &pass.windows);
            direct_s += estimate.direct_s(radius);
            // Transforms search everywhere as far as the pass, and the vectors are then read off direct sums.
            transform_s += estimate.transform_s(search) + estimate.direct_s(CLOSE);
        }
        let has_memory = shared_sums::fit(&pass.windows, radius, volumes.pairs.len());
        let (is_transform, reason) = match route {
            Route::Direct => (false, Reason::Asked),
            Route::Transform => (true, Reason::Asked),
            Route::Auto if is_close => (false, Reason::Close),
            Route::Auto if !has_memory => (true, Reason::Memory),
            Route::Auto => (transform_s < direct_s, Reason::Faster),
        };
        Self { is_transform, reason, direct_s, transform_s }
    }
}
