//! Projection and back-projection without a matrix, for solvers of your own.

use super::{choice::Operator, plane::Plane, voxels::VoxelWeights};
use lf_core::{Weights, weights::RowSet};
use ndarray::{Array2, ArrayView2};

/// The weights of a support's voxels as two operations.
pub struct Projector<'a> {
    operator: Operator<'a>,
    plane: Plane,
    voxels: usize,
    width: usize,
}

impl<'a> Projector<'a> {
    /// For the voxels `indices` (rising) of the weights' grid. Weights are kept if they take no more than `most_bytes`,
    /// and made at every use otherwise.
    pub fn new(weights: &'a Weights, indices: &[u64], most_bytes: u64) -> Self {
        let [width, height] = weights.sensor_px();
        let kept = VoxelWeights::new(weights, indices, 1, most_bytes);
        let operator = if kept.kept.is_some() { Operator::Voxels(kept) } else { Operator::remade(weights, indices) };
        Self { operator, plane: Plane::new(width, height), voxels: indices.len(), width }
    }

    /// Weights that one projection or back-projection touches; an estimate if they are not kept.
    pub fn weights(&self) -> u64 {
        self.operator.weights()
    }

    /// p_i = sum_j w_ij E_j: the image, shape (height, width), of one strength for each voxel. Panics for another
    /// number of strengths.
    pub fn project(&mut self, strengths: &[f32]) -> Array2<f32> {
        assert_eq!(strengths.len(), self.voxels, "one strength for each voxel");
        self.operator.project(RowSet::ALL, strengths, &mut self.plane);
        let Plane { stride, values } = &self.plane;
        Array2::from_shape_fn((values.len() / stride, self.width), |(row, column)| values[row * stride + column])
    }

    /// (sum_i w_ij v_i, sum_i w_ij) of each voxel, for an image `v`. Panics unless it has the sensor's size.
    pub fn back_project(&mut self, image: ArrayView2<f32>) -> Vec<(f32, f32)> {
        let stride = self.plane.stride;
        let height = self.plane.values.len() / stride;
        assert_eq!(image.dim(), (height, self.width), "the sensor's image");
        for (values, row) in self.plane.values.chunks_mut(stride).zip(image.rows()) {
            values[..self.width].iter_mut().zip(row).for_each(|(value, pixel)| *value = *pixel);
        }
        let (mut sums, mut weights) = (vec![0f32; self.voxels], vec![0f32; self.voxels]);
        self.operator.back_project(RowSet::ALL, &self.plane, &mut sums, |_, out, sum, _| *out = sum);
        self.operator.back_project(RowSet::ALL, &self.plane, &mut weights, |_, out, _, weight| *out = weight);
        sums.into_iter().zip(weights).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{cameras, grid, hash, voxels};
    use lf_core::weights::{Basis, Model};

    /// The adjoint: <W e, v> = <e, W' v> for any e and v.
    #[test]
    fn back_projection_is_the_transpose() {
        let grid = grid();
        let indices = voxels(&grid);
        let strengths: Vec<f32> = (0..indices.len()).map(hash).collect();
        for camera in cameras() {
            let weights = Weights::choose(&camera, &grid, Model::Exact, Basis::Blob { sigma_px: 0.65 }).unwrap();
            let [width, height] = weights.sensor_px();
            let image = Array2::from_shape_fn((height, width), |(row, column)| hash(1000 + row * width + column));
            for most_bytes in [0, 1 << 30] {
                let mut projector = Projector::new(&weights, &indices, most_bytes);
                let product = |(a, b): (&f32, &f32)| f64::from(*a) * f64::from(*b);
                let left: f64 = projector.project(&strengths).iter().zip(&image).map(product).sum();
                let back = projector.back_project(image.view());
                let right: f64 = strengths.iter().zip(back.iter().map(|(sum, _)| sum)).map(product).sum();
                assert!(left > 1.0 && (left / right - 1.0).abs() < 1e-5, "{most_bytes}, {camera:?}: {left} {right}");
                assert!(projector.weights() > 10_000);
            }
        }
    }
}
