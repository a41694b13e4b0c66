//! A pass, done once or again and again.

use crate::deform::matched;
use crate::error::{Error, Side};
use crate::level::{Done, Level, Search, Trial, Vector};
use crate::mask::Mask;
use crate::options::{Deform, Options, Pass, triple};
use crate::outcome::Repeat;
use crate::predictor::Predictor;
use crate::sparse::Rows;

/// No window of a pass holds a peak.
pub(crate) struct Lost;

impl Lost {
    /// What to tell of it.
    pub fn in_pass(self, number: usize, pass: &Pass) -> Error {
        let found = format!("no peak within {} voxels in any window of pass {}", triple(pass.search), number + 1);
        Error::new(Side::Both, found, "wanted the same particles in both, or a wider search")
    }
}

/// A pass being done, once or again and again.
pub(crate) struct Run<'a> {
    level: &'a Level<'a>,
    volumes: &'a [[Rows; 2]],
    mask: &'a Mask<'a>,
    options: &'a Options,
    /// What is known of the field: from the pass before, then from the last repeat.
    pub predictor: Option<Predictor>,
    /// The volumes of the last repeat and what they were deformed by, where they were.
    pub deformed: Option<Vec<[Rows; 2]>>,
    deformed_by: Option<Predictor>,
    pub vectors: Vec<Vector>,
    pub repeats: Vec<Repeat>,
}

impl<'a> Run<'a> {
    pub fn new(
        level: &'a Level,
        volumes: &'a [[Rows; 2]],
        mask: &'a Mask,
        options: &'a Options,
        predictor: Option<Predictor>,
    ) -> Self {
        Self {
            level,
            volumes,
            mask,
            options,
            predictor,
            deformed: None,
            deformed_by: None,
            vectors: Vec::new(),
            repeats: Vec::new(),
        }
    }

    /// Does the pass up to `most` times, until it stalls, or else until the `next` one can follow. What is left out is counted
    /// as done.
    pub fn times(&mut self, most: usize, next: Option<&Pass>, watch: &(dyn Fn(u64) + Sync)) -> Result<(), Lost> {
        let mut done = 0;
        while done < most {
            done += 1;
            if !self.repeat(watch) {
                break;
            }
            if self.stalled() || next.is_some_and(|next| !too_steep(self.change_across(next), next)) {
                break;
            }
        }
        watch(((most - done) * self.level.lattice.count()) as u64);
        if self.repeats.is_empty() { Err(Lost) } else { Ok(()) }
    }

    /// Does the pass once more. Where that finds less than the time before, or nothing, it changes nothing and is the last.
    fn repeat(&mut self, watch: &(dyn Fn(u64) + Sync)) -> bool {
        let pass_vox = self.level.pass_vox();
        let across = self.change_across(&pass_vox);
        let asked = match self.options.deform {
            Deform::Auto => !self.repeats.is_empty() || too_steep(across, &pass_vox),
            Deform::Always => true,
            Deform::Never => false,
        };
        let field = self.predictor.as_ref().filter(|_| asked);
        let deformed = field.map(|field| self.moved(field));
        let trial = match (&deformed, field) {
            (Some(pairs), Some(_)) => {
                Trial { pairs: pairs.iter().map(|pair| pair.each_ref()).collect(), deformed_by: field }
            }
            _ => self.level.plain(),
        };
        let search = Search {
            predictor: self.predictor.as_ref(),
            // Vectors of deformed volumes are known well enough for a close look.
            known: self.repeats.last().filter(|before| before.deformed).map(|_| self.vectors.as_slice()),
            route: self.options.route,
            test: &self.options.median_test,
        };
        let Done { mut vectors, counts, cost_s: [direct_s, transform_s], transform } =
            self.level.run(&trial, &search, watch);
        let heights: Vec<f64> = vectors.iter().filter_map(Vector::reading).map(|reading| reading.height).collect();
        let repeat = Repeat {
            deformed: trial.deformed_by.is_some(),
            change_across_vox: across.into_iter().fold(0.0, f64::max),
            change_vox: change(&self.vectors, &vectors),
            correlation: heights.iter().sum::<f64>() / heights.len() as f64,
            direct_s,
            transform_s,
            transform,
            counts,
        };
        // What deformation moved out of sight stays as it was seen before.
        for (vector, before) in vectors.iter_mut().zip(&self.vectors) {
            if *vector == Vector::NoData {
                *vector = *before;
            }
        }
        let worse = self.repeats.last().is_some_and(|before| {
            let fewer = heights.len() * 10 < self.vectors.iter().filter_map(Vector::reading).count() * 9;
            // Deformed and plain volumes correlate differently.
            fewer || (before.deformed && repeat.correlation + Self::WORSE < before.correlation)
        });
        let Some(predictor) = self.level.predictor(&vectors).filter(|_| !worse) else { return false };
        self.deformed_by = field.cloned();
        (self.vectors, self.predictor, self.deformed) = (vectors, Some(predictor), deformed);
        self.repeats.push(repeat);
        true
    }

    /// Constant: a mean correlation this much lower than the time before is none of the noise's doing.
    const WORSE: f64 = 0.02;

    /// Constant: changes that shrink by less lead nowhere.
    const NO_LESS: f64 = 0.9;

    /// Whether another repeat would change nothing that matters: little changed, or no less than the time before.
    fn stalled(&self) -> bool {
        let [.., before, last] = self.repeats.as_slice() else { return false };
        last.change_vox < self.options.stall_vox || last.change_vox > Self::NO_LESS * before.change_vox
    }

    /// What each component is predicted to change by across a window of `pass`, voxels.
    fn change_across(&self, pass: &Pass) -> [f64; 3] {
        self.predictor.as_ref().map_or([0.0; 3], |field| field.change_across(pass.window))
    }

    /// Share of the light smoothing in what the last repeat started from, by node and component: all of it where it did not.
    pub fn light(&self) -> Vec<[f64; 3]> {
        let count = self.level.lattice.count();
        match &self.deformed_by {
            Some(field) if field.count() == count => (0..count).map(|node| field.light(node)).collect(),
            _ => vec![[1.0; 3]; count],
        }
    }

    fn moved(&self, field: &Predictor) -> Vec<[Rows; 2]> {
        let one = |pair: &[Rows; 2]| matched(pair.each_ref(), field, self.mask).map(|rows| self.level.binned(rows));
        self.volumes.iter().map(one).collect()
    }

    /// The volumes laid on each other by what was measured: those of the last repeat, or made now.
    pub fn matched(&mut self) -> Vec<[Rows; 2]> {
        match (self.deformed.take(), &self.predictor) {
            (Some(pairs), _) => pairs,
            (None, Some(field)) => self.moved(field),
            (None, None) => unreachable!("a pass that was done leaves a predictor"),
        }
    }
}

/// Whether a component changes by more across a window of a pass than that looks for along it, voxels.
fn too_steep(across_vox: [f64; 3], pass: &Pass) -> bool {
    (0..3).any(|axis| across_vox[axis] > pass.search[axis] as f64)
}

/// Root mean square change of a component between two vectors measured at one place, voxels; NaN where there are none.
fn change(before: &[Vector], after: &[Vector]) -> f64 {
    let both = before.iter().zip(after).filter_map(|(before, after)| Some((before.reading()?, after.reading()?)));
    let (mut sum, mut count) = (0.0, 0);
    for (before, after) in both {
        sum += (0..3).map(|a| (after.shift_vox[a] - before.shift_vox[a]).powi(2)).sum::<f64>();
        count += 3;
    }
    (sum / count as f64).sqrt()
}
