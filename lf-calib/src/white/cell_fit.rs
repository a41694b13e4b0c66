//! The mean cell, fitted to the pixels of the lenslets that follow the lattice.

use super::followed::{FollowedLattice, few};
use super::lenslet_fit::{LensletFit, window};
use super::mean_cell::{MeanCell, TABLE, TABLE_PER_PX, knots_of};
use super::{basis::shortest, cell_equations::CellEquations, profile::ProfileEquations};
use crate::{fit::polynomial::middle_px, fit::robust::chosen};
use glam::{DMat2, DVec2};
use lf_core::{Refusal, camera::Aperture, statistics::ranked};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Pixels that the round part and the remainder of the mean cell are fitted to. More cost time and gain nothing.
const ROUND_PIXELS: usize = 1 << 15;
const REMAINDER_PIXELS: usize = 1 << 18;
/// While the lattice is being followed, the pixels are fewer by this factor.
const ROUGH: usize = 4;
/// Smallest standard deviation of the remainder that counts, over that of the round part. A smaller one is due to
/// sampling and noise.
const LEAST_REMAINDER: f64 = 0.03;
/// With a second stop, one in `LEAST_CUT` lenslets gives the cell, those cut least, but at least `FEWEST_UNCUT`.
const LEAST_CUT: usize = 10;
const FEWEST_UNCUT: usize = 100;

impl FollowedLattice {
    pub fn fit(&mut self, image: ArrayView2<f32>) -> Result<(), Refusal> {
        let kept = self.fit_smooth()?;
        let followed = self.least_cut(chosen(&self.fits, &kept), image.dim());
        (self.stop, self.cell) = self.fit_cell(image, &followed).ok_or_else(|| few(followed.len()))?;
        Ok(())
    }

    /// The lenslets that a second stop cuts least. A disc seen from one side does not show both its radius and its
    /// place.
    pub fn least_cut(&self, mut fits: Vec<(DVec2, LensletFit)>, size: (usize, usize)) -> Vec<(DVec2, LensletFit)> {
        let Some(stops) = &self.stops else { return fits };
        let cut = |fit: &(DVec2, LensletFit)| stops.cut_px(fit.1.centre_px - middle_px(size));
        let mut cuts: Vec<f64> = fits.iter().map(cut).collect();
        let rank = (cuts.len() / LEAST_CUT).max(FEWEST_UNCUT).min(cuts.len().saturating_sub(1));
        let limit = ranked(&mut cuts, rank).unwrap_or(0.0);
        fits.retain(|fit| cut(fit) <= limit);
        fits
    }

    /// The mean cell about the smooth lattice: its round or square part, whichever explains more, plus the remainder if
    /// that is large enough. A lattice that rests has found its stop.
    fn fit_cell(&self, image: ArrayView2<f32>, fits: &[(DVec2, LensletFit)]) -> Option<(Aperture, MeanCell)> {
        let basis = self.basis_px;
        let knots = knots_of(basis, TABLE_PER_PX, TABLE);
        let thin = thinned(fits, basis, if self.is_whole { ROUND_PIXELS } else { ROUND_PIXELS / ROUGH });
        let part = |stop: Aperture| {
            let empty = || (ProfileEquations::new(stop, basis), Vec::new());
            let sum = self.sum_over(
                image,
                &thin,
                empty,
                |(equations, line), offset, value| equations.add(offset, value, line),
                |(sum, _), (equations, _)| sum.merge(equations),
            );
            let (explained, table) = sum.0.solve(knots)?;
            Some((explained, stop, table))
        };
        // Round parts alone would leave an error of 0.06 % in the pitch of squares in line with the pixels.
        let is_open = |stop: &Aperture| !self.is_settled || *stop == self.stop;
        let parts = [Aperture::Circle, Aperture::Square].into_iter().filter(is_open).filter_map(part);
        let (_, stop, mut table) = parts.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let cell = MeanCell::through(knots, &table);
        if !self.is_settled {
            return Some((stop, cell));
        }

        let to_cell = basis.inverse();
        let remainder = self.sum_over(
            image,
            &thinned(fits, basis, REMAINDER_PIXELS),
            || CellEquations::new(basis),
            |equations, offset, value| equations.add(to_cell * offset, value - cell.at(to_cell * offset).0),
            CellEquations::merge,
        );
        let remainder = remainder.solve(true);
        let left: Vec<f64> = (0..table.len()).map(|knot| remainder.at(MeanCell::place(knots, knot)).0).collect();
        if deviation(&left) / deviation(&table) < LEAST_REMAINDER {
            return Some((stop, cell));
        }
        table.iter_mut().zip(&left).for_each(|(round, left)| *round += *left);
        Some((stop, MeanCell::through(knots, &table)))
    }

    /// A sum over pixels of lenslets. `add` gets a pixel's offset from the smooth lattice and (count - floor) / gain.
    pub fn sum_over<T: Send>(
        &self,
        image: ArrayView2<f32>,
        fits: &[(DVec2, LensletFit)],
        empty: impl Fn() -> T + Sync,
        add: impl Fn(&mut T, DVec2, f64) + Sync,
        merge: impl Fn(&mut T, &T),
    ) -> T {
        let shortest = shortest(self.basis_px);
        // Always eight sums, added in order: the result must not depend on the number of threads.
        let parts: Vec<T> = fits
            .par_chunks(fits.len().div_ceil(8).max(1))
            .map(|fits| {
                let mut part = empty();
                for (index, fit) in fits {
                    let centre = self.smooth.at(*index);
                    let untouched = self.untouched(centre, image.dim());
                    for (pixel, offset) in window(centre, shortest, image.dim()).into_iter().flatten() {
                        if untouched.as_ref().is_none_or(|untouched| untouched.holds(offset)) {
                            add(&mut part, offset, fit.level(image[pixel] as f64, offset));
                        }
                    }
                }
                part
            })
            .collect();
        let mut sum = empty();
        parts.iter().for_each(|part| merge(&mut sum, part));
        sum
    }
}

/// Evenly chosen lenslets that hold about `pixels` pixels in all.
pub(crate) fn thinned(fits: &[(DVec2, LensletFit)], basis_px: DMat2, pixels: usize) -> Vec<(DVec2, LensletFit)> {
    let each = (1.2 * shortest(basis_px).powi(2)).ceil() as usize;
    fits.iter().step_by((fits.len() * each).div_ceil(pixels).max(1)).copied().collect()
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}
