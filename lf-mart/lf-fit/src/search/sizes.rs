//! Sizes of particles that differ. A particle gets a size of its own as far as its light shows it; the spread of all
//! sizes is the prior of each.

use super::particles::Particles;
use crate::cameras::shape::Shape;
use crate::cameras::view::CameraView;
use crate::particle::Particle;
use crate::solve::covariance::Prior;
use crate::solve::size::{SizeEquation, SizeSpread};
use lf_core::Refusal;

/// Number of particles, about, that show whether sizes differ.
const TRIED: usize = 1000;
/// A smaller step of a size, as a share of its uncertainty, wakes no particle.
const ENOUGH: f64 = 0.2;

impl Particles<'_> {
    /// Gives each particle the size that its light and the sizes of all particles make likeliest, unless all may be of
    /// one size. Where the usual size `is_free`, the middle one becomes it. Returns whether a size has changed.
    pub(crate) fn fit_sizes(&mut self, prior: Prior, is_free: bool) -> Result<bool, Refusal> {
        let misfit = self.cameras.misfit().max(1.0);
        let every = self.list.len().div_ceil(TRIED);
        let is_likely = self.size_spread.is_some() || every == 1 || self.sizes(every, prior, misfit).is_some();
        let found = if is_likely { self.sizes(1, prior, misfit) } else { None };
        self.size_spread = found.as_ref().map(|(spread, _)| *spread);
        let Some((spread, equations)) = found else {
            let had_sizes = self.list.iter().any(|particle| particle.log_size != 0.0);
            self.list.iter_mut().for_each(|particle| particle.log_size = 0.0);
            return Ok(had_sizes);
        };
        for (n, equation) in equations {
            let before = self.list[n];
            let (log_size, std, step) = equation.among(spread, before.log_size, misfit);
            self.list[n] = Particle { log_size, ..self.cameras.moved(&before, &step) };
            if (log_size - before.log_size).abs() > ENOUGH * std {
                (self.is_awake[n], self.is_whole[n]) = (true, false);
            }
        }
        if !is_free {
            return Ok(true);
        }
        let CameraView { shape, shape_std_px, .. } = self.cameras.views[0];
        let middle = spread.middle();
        self.cameras.views[0].set_shape(Shape { sigma_px: shape.sigma_px * middle.exp(), ..shape }, shape_std_px)?;
        self.list.iter_mut().for_each(|particle| particle.log_size -= middle);
        Ok(true)
    }

    /// How the sizes of one particle in `every` spread, and the numbers of these particles with the equations of their
    /// sizes; None if they may be one size.
    fn sizes(&mut self, every: usize, prior: Prior, misfit: f64) -> Option<(SizeSpread, Vec<(usize, SizeEquation)>)> {
        let asked = (0..self.list.len()).map(|n| n % every == 0).collect();
        let awake = std::mem::replace(&mut self.is_awake, asked);
        let found = self.of_each(|tile, equations, n| {
            tile.members[n].number.map(|number| (number, tile.size_equation(equations, n, prior)))
        });
        self.is_awake = awake;
        let equations: Vec<(usize, SizeEquation)> = found.into_iter().flatten().collect();
        let alone = |(n, equation): &(usize, SizeEquation)| equation.alone(self.list[*n].log_size, misfit);
        let spread = SizeSpread::of(&equations.iter().filter_map(alone).collect::<Vec<_>>())?;
        Some((spread, equations))
    }
}
