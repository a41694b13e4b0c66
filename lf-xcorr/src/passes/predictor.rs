//! The prediction of a pass for the next one: a displacement at every place.

use crate::vectors::{Nodes, filled, smoothed_by_evidence};
use glam::DVec3;
use lf_core::statistics::ranked;

/// A field of displacements between the nodes of a pass, in voxels.
#[derive(Debug, Clone)]
pub(crate) struct Predictor {
    nodes: Nodes,
    vectors: Vec<DVec3>,
    /// Fraction of the narrow smoothing, by node and component.
    pub narrow_share: Vec<DVec3>,
}

impl Predictor {
    /// Constant: share of the nodes that may change more, because noise alone does that to a uniform field.
    const CALM: f64 = 0.02;

    /// Fills holes and smooths over `smoothing` nodes ([`smoothed_by_evidence`]). `None` if no vector was measured.
    pub fn new(
        shape: [usize; 3],
        first_vox: DVec3,
        step_vox: DVec3,
        vectors: Vec<Option<DVec3>>,
        smoothing: DVec3,
        noise_ratio: f64,
    ) -> Option<Self> {
        let (vectors, narrow_share) = smoothed_by_evidence(shape, &filled(shape, vectors)?, smoothing, noise_ratio);
        Some(Self { nodes: Nodes { shape, first: first_vox, step: step_vox }, vectors, narrow_share })
    }

    /// The change of each component across a window, along x, y and z together, voxels: all but [`Predictor::CALM`] of
    /// the nodes stay below it.
    pub fn change_across(&self, window: [usize; 3]) -> [f64; 3] {
        let Nodes { shape, step, .. } = self.nodes;
        let stride = [1, shape[0], shape[0] * shape[1]];
        std::array::from_fn(|component| {
            let across = |node: usize| -> f64 {
                let along = |axis: usize| {
                    if node / stride[axis] % shape[axis] + 1 >= shape[axis] {
                        return 0.0;
                    }
                    let rise = self.vectors[node + stride[axis]][component] - self.vectors[node][component];
                    (rise / step[axis] * window[axis] as f64).abs()
                };
                (0..3).map(along).sum()
            };
            let mut changes: Vec<f64> = (0..self.vectors.len()).map(across).collect();
            let rank = ((1.0 - Self::CALM) * (changes.len() - 1) as f64) as usize;
            ranked(&mut changes, rank).expect("a pass has at least one window")
        })
    }

    /// The displacement at a place, voxels: [`Nodes::at`].
    pub fn at(&self, place_vox: DVec3) -> DVec3 {
        self.nodes.at(&self.vectors, place_vox)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_field_is_filled_smoothed_and_interpolated_into_itself() {
        let shape = [5, 4, 3];
        let truth = |x: f64, y: f64, z: f64| DVec3::new(1.0 + 0.2 * x - 0.1 * y, 0.3 * z, -2.0 + 0.05 * x);
        let mut field: Vec<_> =
            (0..60).map(|k| Some(truth((k % 5) as f64, (k / 5 % 4) as f64, (k / 20) as f64))).collect();
        for hole in [0, 13, 27, 32, 59] {
            field[hole] = None;
        }
        let step = DVec3::new(2.0, 3.0, 4.0);
        let predictor = Predictor::new(shape, DVec3::splat(10.0), step, field, DVec3::splat(1.4), 0.1).unwrap();
        let found = predictor.at(10.0 + step * DVec3::new(1.3, 2.6, 1.5));
        let wanted = truth(1.3, 2.6, 1.5);
        assert!((found - wanted).abs().max_element() < 0.02, "{found:?} {wanted:?}");
    }

    #[test]
    fn nothing_measured_predicts_nothing() {
        assert!(Predictor::new([2, 2, 1], DVec3::ZERO, DVec3::ONE, vec![None; 4], DVec3::ONE, 0.1).is_none());
    }

    #[test]
    fn the_change_across_a_window_is_that_of_its_gradient() {
        let shear = (0..60).map(|k| Some(DVec3::new(0.5 * (k / 5 % 4) as f64, 0.0, -0.25 * (k / 20) as f64)));
        let step = DVec3::new(2.0, 4.0, 2.0);
        let predictor = Predictor::new([5, 4, 3], DVec3::ZERO, step, shear.collect(), DVec3::splat(1.4), 0.1).unwrap();
        // u rises by 1/8 a voxel along y, w falls by 1/8 along z.
        let found = predictor.change_across([100, 8, 16]);
        (0..3).for_each(|a| assert!((found[a] - [1.0, 0.0, 2.0][a]).abs() < 1e-9, "{found:?}"));
    }
}
