//! The lattice as far as it has been followed through a white image: its lenslets, and the smooth lattice through them.

use super::lenslet_fit::{LensletFit, fit_lenslet, window};
use super::{basis::shortest, cats_eye::TwoStops, cats_eye::Untouched, mean_cell::MeanCell};
use crate::fit::polynomial::{Polynomial, TiePoint, middle_px};
use crate::fit::robust::{chosen, without_outliers};
use glam::{DMat2, DVec2};
use lf_core::{Refusal, camera::Aperture};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Number of lenslets from which the smooth lattice may bend: a cubic has ten coefficients.
const ENOUGH_TO_BEND: usize = 150;
/// Smallest number of lenslets that makes a lattice.
pub(crate) const FEWEST: usize = 12;
/// A lenslet is read if the mean cell explains at least this share of its pixels' variance.
const LEAST_EXPLAINED: f64 = 0.3;
/// Largest relative change of the gain from one lenslet to the next. A larger one comes from a bad extrapolation.
const MOST_SHADE: f64 = 0.2;

pub(crate) fn few(found: usize) -> Refusal {
    Refusal::new(
        format!("only {found} lenslets follow one lattice"),
        format!("wanted a white image of at least {FEWEST} lenslets, evenly lit"),
    )
}

pub(crate) struct FollowedLattice {
    pub cell: MeanCell,
    /// The stop whose profile explains the cell best.
    pub stop: Aperture,
    /// Lattice vectors as columns, px.
    pub basis_px: DMat2,
    /// The smooth lattice: image position, px, from lattice index.
    pub smooth: Polynomial,
    /// The gain, from lattice index. Only x is used.
    pub gain: Polynomial,
    /// Distance that the lattice has been followed to, in shortest lattice vectors.
    pub radius: f64,
    /// Whether it reaches the corners of the frame. Until then a rough cell is enough.
    pub is_whole: bool,
    /// Whether it rests on the round part of the cell. Only then can the remainder be separated from a wrong centre.
    pub is_settled: bool,
    /// Once it has been seen.
    pub stops: Option<TwoStops>,
    /// Lattice index and fit of each lenslet that was read.
    pub fits: Vec<(DVec2, LensletFit)>,
}

impl FollowedLattice {
    /// Reads lenslets within the radius, about `most` of them, evenly spread. Returns how many were tried.
    pub fn read(&mut self, image: ArrayView2<f32>, most: usize) -> usize {
        let shortest = shortest(self.basis_px);
        let mut indices = self.indices(image.dim());
        let share = most as f64 / indices.len() as f64;
        // Multiples of irrational numbers are spread evenly between 0 and 1, along rows and along columns.
        indices.retain(|index| (index.x * 0.618_034 + index.y * 0.414_214).rem_euclid(1.0) < share);
        indices.retain(|&index| window(self.smooth.at(index), shortest, image.dim()).is_some());
        self.fits = indices
            .par_iter()
            .filter_map(|&index| {
                let (from, shade) = (self.smooth.at(index), self.shade_at(index));
                let untouched = self.untouched(from, image.dim());
                let fit = fit_lenslet(image, &self.cell, self.basis_px, from, shade, untouched.as_ref())?;
                (fit.explained >= LEAST_EXPLAINED).then_some((index, fit))
            })
            .collect();
        indices.len()
    }

    /// The pixels that a second stop leaves of the lenslet imaged at `centre_px`. None if it leaves all.
    pub fn untouched(&self, centre_px: DVec2, size: (usize, usize)) -> Option<Untouched> {
        Untouched::under(self.stops.as_ref()?, centre_px - middle_px(size), self.basis_px)
    }

    /// Lattice indices within the radius that may be in a frame of this (height, width), row by row.
    pub fn indices(&self, (height, width): (usize, usize)) -> Vec<DVec2> {
        let to_index = self.basis_px.inverse();
        let corners = [(0, 0), (width, 0), (0, height), (width, height)]
            .map(|(x, y)| to_index * (DVec2::new(x as f64, y as f64) - self.smooth.at(DVec2::ZERO)));
        let low = corners.iter().copied().reduce(DVec2::min).unwrap_or_default().floor() - 3.0;
        let high = corners.iter().copied().reduce(DVec2::max).unwrap_or_default().ceil() + 3.0;
        let reach = (self.radius * shortest(self.basis_px)).powi(2);
        let within = |n: f64, (low, high): (f64, f64)| n.clamp(low, high) as i64;
        let side = 2.0 * self.radius;
        let rows = within(low.y, (-side, side))..=within(high.y, (-side, side));
        let columns = within(low.x, (-side, side))..=within(high.x, (-side, side));
        rows.flat_map(|row| columns.clone().map(move |column| DVec2::new(column as f64, row as f64)))
            .filter(|&index| (self.basis_px * index).length_squared() <= reach)
            .collect()
    }

    /// Fits the smooth lattice and the gain to the lenslets that were read. Returns which of them it kept.
    pub fn fit_smooth(&mut self) -> Result<Vec<bool>, Refusal> {
        let count = self.fits.len();
        let degree = if count < ENOUGH_TO_BEND { 1 } else { 3 };
        let fit = |ties: &[TiePoint]| Polynomial::through(ties, degree);
        let ties: Vec<TiePoint> = self.fits.iter().map(|(index, fit)| (*index, fit.centre_px)).collect();
        let fitted = without_outliers(&ties, &self.spreads(), fit, Polynomial::at);
        let (smooth, kept) = fitted.filter(|_| count >= FEWEST).ok_or_else(|| few(count))?;
        self.smooth = smooth;
        let gains: Vec<TiePoint> = self.fits.iter().map(|(index, fit)| (*index, fit.gain * DVec2::X)).collect();
        if let Some((gain, _)) = without_outliers(&gains, &vec![1.0; count], fit, Polynomial::at) {
            self.gain = gain;
        }
        let affine = Polynomial::through(&chosen(&ties, &kept), 1).ok_or_else(|| few(count))?;
        let basis = affine.basis_at(DVec2::ZERO);
        let moved = basis - self.basis_px;
        // A lattice that changes its shape on the way is no lattice. One that shrinks to nothing would have no end.
        if !moved.is_finite() || moved.x_axis.length() + moved.y_axis.length() > 0.2 * shortest(self.basis_px) {
            return Err(few(count));
        }
        self.basis_px = basis;
        Ok(kept)
    }

    /// Effect of noise on each centre that was read, in a common unit.
    pub fn spreads(&self) -> Vec<f64> {
        self.fits.iter().map(|(_, fit)| fit.spread_px).collect()
    }

    /// Relative change of the gain per px at an index, from the lenslets around it.
    fn shade_at(&self, index: DVec2) -> DVec2 {
        let gain = self.gain.at(index).x;
        let steps = self.gain.basis_at(index);
        let slope = self.basis_px.inverse().transpose() * DVec2::new(steps.x_axis.x, steps.y_axis.x);
        if gain > 0.0 { (slope / gain).clamp_length_max(MOST_SHADE / shortest(self.basis_px)) } else { DVec2::ZERO }
    }
}
