//! What a pass predicts for the next: a field of displacements at every place.

use crate::evidence::smoothed_by_evidence;
use crate::fill::filled;

/// A field of displacements between the nodes of a pass, in voxels.
#[derive(Debug, Clone)]
pub(crate) struct Predictor {
    shape: [usize; 3],
    first_vox: [f64; 3],
    step_vox: [f64; 3],
    vectors: Vec<[f64; 3]>,
    /// Share of the light smoothing, by node and component.
    light: Vec<[f64; 3]>,
}

impl Predictor {
    /// Fills every hole and smooths over `smoothing` nodes, or more where there is nothing but noise, which is `noise_ratio`
    /// ([`smoothed_by_evidence`]); `None` where no vector was measured.
    pub fn new(
        shape: [usize; 3],
        first_vox: [f64; 3],
        step_vox: [f64; 3],
        vectors: Vec<Option<[f64; 3]>>,
        smoothing: [f64; 3],
        noise_ratio: f64,
    ) -> Option<Self> {
        let (vectors, light) = smoothed_by_evidence(shape, filled(shape, vectors)?, smoothing, noise_ratio);
        Some(Self { shape, first_vox, step_vox, vectors, light })
    }

    /// Number of nodes.
    pub fn count(&self) -> usize {
        self.vectors.len()
    }

    /// Share of the light smoothing at a node, by component.
    pub fn light(&self, node: usize) -> [f64; 3] {
        self.light[node]
    }

    /// The change of each component across a window of `window` voxels, along x, y and z together, that all but
    /// [`Predictor::CALM`] of the nodes stay below, voxels.
    pub fn change_across(&self, window: [usize; 3]) -> [f64; 3] {
        let stride = [1, self.shape[0], self.shape[0] * self.shape[1]];
        std::array::from_fn(|component| {
            let across = |node: usize| -> f64 {
                let along = |axis: usize| {
                    if node / stride[axis] % self.shape[axis] + 1 >= self.shape[axis] {
                        return 0.0;
                    }
                    let rise = self.vectors[node + stride[axis]][component] - self.vectors[node][component];
                    (rise / self.step_vox[axis] * window[axis] as f64).abs()
                };
                (0..3).map(along).sum()
            };
            let mut changes: Vec<f64> = (0..self.vectors.len()).map(across).collect();
            let place = ((1.0 - Self::CALM) * (changes.len() - 1) as f64) as usize;
            *changes.select_nth_unstable_by(place, f64::total_cmp).1
        })
    }

    /// Constant: a fiftieth of the nodes may change more; they are what noise does to a uniform field.
    const CALM: f64 = 0.02;

    /// The displacement at a place, voxels: trilinear between nodes, the outermost gradient carried on for up to
    /// [`Predictor::BEYOND`] nodes, constant farther out.
    pub fn at(&self, place_vox: [f64; 3]) -> [f64; 3] {
        let mut part = [0.0; 3];
        let mut corner = 0;
        let mut stride = [0; 3];
        let mut length = 1;
        for axis in 0..3 {
            let n = self.shape[axis];
            let last = (n - 1) as f64;
            let place = ((place_vox[axis] - self.first_vox[axis]) / self.step_vox[axis])
                .clamp(-Self::BEYOND, last + Self::BEYOND);
            let low = place.clamp(0.0, (last - 1.0).max(0.0)).floor();
            if n > 1 {
                (part[axis], stride[axis]) = (place - low, length);
            }
            corner += low as usize * length;
            length *= n;
        }
        let mix = |from: [f64; 3], to: [f64; 3], part: f64| -> [f64; 3] {
            std::array::from_fn(|a| from[a] + part * (to[a] - from[a]))
        };
        let along_x = |corner: usize| mix(self.vectors[corner], self.vectors[corner + stride[0]], part[0]);
        let along_y = |corner: usize| mix(along_x(corner), along_x(corner + stride[1]), part[1]);
        mix(along_y(corner), along_y(corner + stride[2]), part[2])
    }

    /// Constant: the outermost windows reach two nodes beyond their centres at three quarters of overlap.
    const BEYOND: f64 = 2.0;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_field_is_filled_smoothed_and_interpolated_into_itself() {
        let shape = [5, 4, 3];
        let truth = |x: f64, y: f64, z: f64| [1.0 + 0.2 * x - 0.1 * y, 0.3 * z, -2.0 + 0.05 * x];
        let mut field: Vec<_> =
            (0..60).map(|k| Some(truth((k % 5) as f64, (k / 5 % 4) as f64, (k / 20) as f64))).collect();
        for hole in [0, 13, 27, 32, 59] {
            field[hole] = None;
        }
        let predictor = Predictor::new(shape, [10.0; 3], [2.0, 3.0, 4.0], field, [1.4; 3], 0.1).unwrap();
        let found = predictor.at([10.0 + 2.0 * 1.3, 10.0 + 3.0 * 2.6, 10.0 + 4.0 * 1.5]);
        let wanted = truth(1.3, 2.6, 1.5);
        (0..3).for_each(|a| assert!((found[a] - wanted[a]).abs() < 0.02, "{found:?} {wanted:?}"));
    }

    #[test]
    fn nothing_measured_predicts_nothing() {
        assert!(Predictor::new([2, 2, 1], [0.0; 3], [1.0; 3], vec![None; 4], [1.0; 3], 0.1).is_none());
    }

    #[test]
    fn the_change_across_a_window_is_that_of_its_gradient() {
        let shear = (0..60).map(|k| Some([0.5 * (k / 5 % 4) as f64, 0.0, -0.25 * (k / 20) as f64])).collect();
        let predictor = Predictor::new([5, 4, 3], [0.0; 3], [2.0, 4.0, 2.0], shear, [1.4; 3], 0.1).unwrap();
        // u rises by 1/8 a voxel along y, w falls by 1/8 along z.
        let found = predictor.change_across([100, 8, 16]);
        (0..3).for_each(|a| assert!((found[a] - [1.0, 0.0, 2.0][a]).abs() < 1e-9, "{found:?}"));
    }
}
