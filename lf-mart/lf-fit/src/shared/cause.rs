//! The likely cause where a camera does not explain its image: the parameter that would lower the squares most, the
//! particles following it, as their slopes foresee (a score test).

use super::shape_fit::Sample;
use crate::cameras::lens::LENSES;
use crate::cameras::shape::Free;
use crate::model::buffers::FitBuffers;
use lf_core::Refusal;

/// A cause lowers the squared differences by at least this share. Calibrated cameras leave 0.0004, a rotation 0.3 mrad
/// off 0.38.
const LEAST_SHARE: f64 = 0.01;
/// Images of bent rays take long: the slopes are those of one in this number of particles.
const EVERY: usize = 4;
/// Damping of the particles' equations.
const DAMPING: f64 = 1e-3;

impl Sample<'_> {
    /// The number of the camera's parameter that explains most beside the shape; None if none explains enough. The
    /// sample has slopes by all of them.
    pub(crate) fn cause(&self) -> Result<Option<usize>, Refusal> {
        let mut buffers = FitBuffers::default();
        let state = self.state(&self.cameras, EVERY, &mut buffers)?;
        let found = self.equations(&state, DAMPING, &mut buffers);
        let with = |lens: Option<usize>| {
            let free = Free { lens: std::array::from_fn(|k| Some(k) == lens), ..self.free };
            found.fall(free.shapes(&self.cameras.first().shape))
        };
        let share = |k: usize| EVERY as f64 * (with(Some(k)) - with(None)) / found.squares;
        let best = (0..LENSES).max_by(|a, b| share(*a).total_cmp(&share(*b)));
        Ok(best.filter(|k| share(*k) > LEAST_SHARE))
    }
}
