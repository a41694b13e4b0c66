//! The evidence of a frame on its camera, for `lf-calib refine`: the equations of the shape, without the size of
//! particles.

use super::sample::Sample;
use crate::cameras::shape::SHAPES;
use crate::model::buffers::FitBuffers;
use crate::solve::joint::LEAST_DAMPING;
use crate::solve::normal::DEEP;
use lf_core::camera::{Evidence, PARAMETERS};
use lf_core::{Camera, Refusal};

/// The size comes first among the unknowns of a shape, the parameters in their order after it.
const SIZE: usize = 0;

impl Sample<'_> {
    /// The evidence, its information divided by the `excess` of the differences over noise.
    pub(crate) fn evidence(&self, excess: f64) -> Result<Evidence, Refusal> {
        let mut buffers = FitBuffers::default();
        let view = self.cameras.first();
        let found = self.equations(&self.state(&self.cameras, 1, &mut buffers)?, (LEAST_DAMPING, DEEP), &mut buffers);

        // Eliminate the size, which each frame may have for itself.
        let is_free = self.free.shapes(&view.shape);
        let own = found.reduced[SIZE][SIZE];
        let share = |a: usize| if is_free[SIZE] && own > 0.0 { found.reduced[a][SIZE] / own } else { 0.0 };
        let information = |a: usize, b: usize| (found.reduced[a][b] - share(a) * found.reduced[SIZE][b]) / excess;
        let gradient = |a: usize| (found.right[a] - share(a) * found.right[SIZE]) / excess;

        // A blur that the camera does not name is not one of its parameters.
        let is_known = |k: &usize| PARAMETERS[k - 1].key != "blur_px" || view.camera.blur.is_some();
        let free: Vec<usize> = (1..SHAPES).filter(|k| is_free[*k]).filter(is_known).collect();
        let values = view.shape.steps_px(view.camera);
        Ok(Evidence {
            camera: Camera { calibration: None, vignetting: None, ..view.camera.clone() },
            frame: 0,
            particles: self.parts.iter().map(|part| part.particles.len()).sum(),
            chi2: 0.0,
            parameters: free.iter().map(|k| PARAMETERS[k - 1].key.to_string()).collect(),
            value_px: free.iter().map(|k| values[k - 1]).collect(),
            gradient: free.iter().map(|k| gradient(*k)).collect(),
            information: free.iter().map(|a| free.iter().map(|b| information(*a, *b)).collect()).collect(),
        })
    }
}
