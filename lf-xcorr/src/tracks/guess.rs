//! A displacement at every place, and how uncertain it is.

use crate::vectors::Nodes;
use glam::DVec3;

/// Displacements at the nodes of a field, and their variances.
#[derive(Debug, Clone)]
pub(crate) struct Guess {
    pub nodes: Nodes,
    pub shift_mm: Vec<DVec3>,
    /// Variance of the difference between a particle's displacement and the guess, mm².
    pub variance_mm2: Vec<DVec3>,
    /// Whether particles decided the node.
    pub is_decided: Vec<bool>,
}

impl Guess {
    /// The displacement of a particle whose midpoint is at a place, mm.
    pub fn shift_mm(&self, middle_mm: DVec3) -> DVec3 {
        self.nodes.curved_at(&self.shift_mm, middle_mm)
    }

    pub fn variance_mm2(&self, middle_mm: DVec3) -> DVec3 {
        self.nodes.shares(middle_mm).iter().map(|(node, share)| *share * self.variance_mm2[*node]).sum()
    }

    /// Whether particles decided more than half of the guess at a place.
    pub fn is_decided(&self, middle_mm: DVec3) -> bool {
        let shares = self.nodes.shares(middle_mm);
        shares.iter().filter(|(node, _)| self.is_decided[*node]).map(|(_, share)| share).sum::<f64>() > 0.5
    }

    /// The midpoint of a particle at `place_mm`, before (`side` 1) or after (-1) its displacement.
    pub fn middle_mm(&self, place_mm: DVec3, side: f64) -> DVec3 {
        // The first estimate of the midpoint gives a better displacement.
        let near = place_mm + 0.5 * side * self.shift_mm(place_mm);
        place_mm + 0.5 * side * self.shift_mm(near)
    }
}
