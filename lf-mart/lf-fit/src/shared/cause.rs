//! The likely cause where a camera does not explain its image: the parameter that would lower the squares most, the
//! particles following it, as their slopes foresee (a score test).

use super::sample::Sample;
use crate::cameras::lens::{LENSES, lens};
use crate::cameras::shape::{ANALYTIC, Free, LEAST_PX, Shape};
use crate::model::buffers::FitBuffers;
use crate::solve::normal::FINE;
use glam::DVec2;
use lf_core::Refusal;

/// A cause lowers the squared differences by at least this share. Calibrated cameras leave 0.0004, a rotation 0.3 mrad
/// off 0.38.
const LEAST_SHARE: f64 = 0.01;
/// Images of bent rays take long: the slopes are those of one in this number of particles.
const EVERY: usize = 4;
/// Damping of the particles' equations.
const DAMPING: f64 = 1e-3;

impl Sample<'_> {
    /// The number of the camera's free parameter that explains most beside the shape; None if none explains enough.
    pub(crate) fn cause(&self) -> Result<Option<usize>, Refusal> {
        let mut buffers = FitBuffers::default();
        let state = self.state(&self.cameras, EVERY, &mut buffers)?;
        let found = self.equations(&state, (DAMPING, FINE), &mut buffers);
        let Shape { lens_px, .. } = self.cameras.first().shape;
        let foreseen = |lens: Option<usize>| {
            let free = Free { lens: std::array::from_fn(|k| Some(k) == lens), ..self.free };
            found.foreseen(free.shapes(&self.cameras.first().shape))
        };
        let camera = self.cameras.first().camera;
        let every = |k: usize| if lens(k).shift_px(camera, DVec2::ZERO).is_some() { 1.0 } else { EVERY as f64 };
        let (_, without) = foreseen(None);
        let causes = (0..LENSES).filter(|k| self.free.lens[*k]).filter_map(|k| {
            let (step, fall) = foreseen(Some(k));
            let share = every(k) * (fall - without) / found.squares;
            let is_worth = share > LEAST_SHARE && (lens_px[k] + step[ANALYTIC + k]).abs() > LEAST_PX;
            is_worth.then_some((k, share))
        });
        Ok(causes.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k))
    }
}
