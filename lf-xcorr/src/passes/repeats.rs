//! A pass, done until its vectors stop changing.

use super::options::{Deform, Options};
use super::pass::{Pass, triple};
use super::prepared::{PreparedPass, Volumes};
use super::search::{Guide, search};
use super::{deform::matched, outcome::Repeat, predictor::Predictor};
use crate::error::{Refused, Side};
use crate::volumes::{Mask, Rows};
use crate::{correlate::Watch, vectors::Vector};
use glam::DVec3;
use lf_core::io;

/// A pass, its vectors, and each time that it was done.
pub(crate) struct Repeats<'a> {
    pass: &'a PreparedPass<'a>,
    /// The volumes to deform. A `Mask::Support` does not cut them; their light outside it may move into it.
    volumes: &'a [[Rows; 2]],
    mask: &'a Mask<'a>,
    options: &'a Options,
    /// The known field: from the pass before, then from the last repeat.
    pub predictor: Option<Predictor>,
    /// The field that the last repeat deformed the volumes by, if it deformed them.
    pub deformed_by: Option<Predictor>,
    /// These volumes; None if a later repeat was worse and released them.
    deformed: Option<Vec<[Rows; 2]>>,
    pub vectors: Vec<Vector>,
    pub done: Vec<Repeat>,
}

impl<'a> Repeats<'a> {
    pub fn new(
        pass: &'a PreparedPass,
        volumes: &'a [[Rows; 2]],
        mask: &'a Mask,
        options: &'a Options,
        predictor: Option<Predictor>,
    ) -> Self {
        let (vectors, done) = (Vec::new(), Vec::new());
        Self { pass, volumes, mask, options, predictor, deformed: None, deformed_by: None, vectors, done }
    }

    /// Does pass `number` up to `max` times: until it stalls, or until the `next` pass can follow. The windows of
    /// repeats that are left out count as done. Refuses volumes without a peak in any window.
    pub fn run(&mut self, number: usize, max: usize, next: Option<&Pass>, watch: Watch) -> Result<(), Refused> {
        let mut done = 0;
        while done < max {
            done += 1;
            let has_changed = self.repeat(watch);
            let can_follow = |next: &Pass| !is_too_steep(self.change_across(next), next);
            if !has_changed || self.has_stalled() || next.is_some_and(can_follow) {
                break;
            }
        }
        watch(((max - done) * self.pass.windows.count()) as u64);
        if self.done.is_empty() {
            let search = triple(self.options.passes[number].search);
            let found = format!("no peak within {search} voxels in any window of pass {}", number + 1);
            return Err(Refused::new(Side::Both, found, "wanted the same particles in both, or a wider search"));
        }
        Ok(())
    }

    /// Does the pass once more. If it finds nothing or less than before, it changes nothing and returns false.
    fn repeat(&mut self, watch: Watch) -> bool {
        let pass_vox = self.pass.binned.in_voxels();
        let across = self.change_across(&pass_vox);
        let is_asked = match self.options.deform {
            Deform::Auto => !self.done.is_empty() || is_too_steep(across, &pass_vox),
            Deform::Always => true,
            Deform::Never => false,
        };
        let field = self.predictor.as_ref().filter(|_| is_asked);
        // One copy is in memory at a time.
        self.deformed = None;
        let deformed = field.map(|field| self.deform(field));
        let volumes = match &deformed {
            Some(pairs) => Volumes { pairs: pairs.iter().map(|pair| pair.each_ref()).collect(), deformed_by: field },
            None => self.pass.plain(),
        };
        let guide = Guide {
            predictor: self.predictor.as_ref(),
            // Vectors of deformed volumes are known well enough for a close search.
            known: self.done.last().filter(|before| before.deformed).map(|_| self.vectors.as_slice()),
            test: &self.options.median_test,
        };
        let (mut vectors, counts) = search(self.pass, &volumes, &guide, watch);
        let heights: Vec<f64> = vectors.iter().filter_map(Vector::fit).map(|fit| fit.height).collect();
        let repeat = Repeat {
            deformed: field.is_some(),
            change_across_vox: across.into_iter().fold(0.0, f64::max),
            change_vox: change(&self.vectors, &vectors),
            correlation: heights.iter().sum::<f64>() / heights.len() as f64,
            counts,
        };
        // Keep the vector of the repeat before where deformation left no data.
        let lost = vectors.iter_mut().zip(&self.vectors).filter(|(vector, _)| **vector == Vector::NoData);
        lost.for_each(|(vector, before)| *vector = *before);
        let is_worse = self.is_worse(&repeat, heights.len());
        let Some(predictor) = self.pass.predictor(&vectors).filter(|_| !is_worse) else { return false };
        self.deformed_by = field.cloned();
        (self.vectors, self.predictor, self.deformed) = (vectors, Some(predictor), deformed);
        self.done.push(repeat);
        true
    }

    /// Whether a repeat that measured `count` vectors found less than the one before.
    fn is_worse(&self, repeat: &Repeat, count: usize) -> bool {
        // Constant: noise alone does not lower the mean correlation by this much from one repeat to the next.
        const WORSE: f64 = 0.02;
        self.done.last().is_some_and(|before| {
            let has_fewer = count * 10 < self.vectors.iter().filter_map(Vector::fit).count() * 9;
            // Deformed and plain volumes correlate differently, so compare deformed repeats only.
            has_fewer || (before.deformed && repeat.correlation + WORSE < before.correlation)
        })
    }

    /// Whether the vectors changed little, or no less than the time before.
    fn has_stalled(&self) -> bool {
        // Constant: the pass does not converge if the change stays above this fraction of the one before.
        const NO_LESS: f64 = 0.9;
        let [.., before, last] = self.done.as_slice() else { return false };
        last.change_vox < Options::STALL_VOX || last.change_vox > NO_LESS * before.change_vox
    }

    /// The predicted change of each component across a window of `pass`, voxels.
    fn change_across(&self, pass: &Pass) -> [f64; 3] {
        self.predictor.as_ref().map_or([0.0; 3], |field| field.change_across(pass.window))
    }

    /// Fraction of the narrow smoothing in the field of the last deformation, by node and component. It is 1 without
    /// deformation, and after deformation by the field of the pass before.
    pub fn narrow_share(&self) -> Vec<DVec3> {
        let count = self.pass.windows.count();
        match self.deformed_by.as_ref().map(|field| &field.narrow_share) {
            Some(share) if share.len() == count => share.clone(),
            _ => vec![DVec3::ONE; count],
        }
    }

    fn deform(&self, field: &Predictor) -> Vec<[Rows; 2]> {
        let deform = |pair: &[Rows; 2]| matched(pair.each_ref(), field, self.mask).map(|rows| self.pass.in_bins(rows));
        // Sums and deformed volumes need pieces of memory of different sizes: return them to the system in between.
        io::release_memory();
        let deformed = self.volumes.iter().map(deform).collect();
        io::release_memory();
        deformed
    }

    /// The volumes deformed onto each other by the measured field, or by the last repeat if it deformed them.
    pub fn matched(&mut self) -> Vec<[Rows; 2]> {
        match (self.deformed.take(), self.deformed_by.as_ref().or(self.predictor.as_ref())) {
            (Some(pairs), _) => pairs,
            (None, Some(field)) => self.deform(field),
            (None, None) => unreachable!("a pass that was done leaves a predictor"),
        }
    }
}

/// Whether a component changes by more across a window of a pass than the pass searches along it, voxels.
fn is_too_steep(across_vox: [f64; 3], pass: &Pass) -> bool {
    (0..3).any(|axis| across_vox[axis] > pass.search[axis] as f64)
}

/// Root mean square change of a component between vectors measured both times, voxels; NaN if there are none.
fn change(before: &[Vector], after: &[Vector]) -> f64 {
    let change = |(before, after): (&Vector, &Vector)| Some(after.fit()?.shift_vox - before.fit()?.shift_vox);
    let changes: Vec<f64> = before.iter().zip(after).filter_map(change).map(DVec3::length_squared).collect();
    (changes.iter().sum::<f64>() / (3 * changes.len()) as f64).sqrt()
}
