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
    /// The volumes of the last repeat, where they were deformed.
    pub deformed: Option<Vec<[Rows; 2]>>,
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
        Self { level, volumes, mask, options, predictor, deformed: None, vectors: Vec::new(), repeats: Vec::new() }
    }

    /// Does the pass up to `most` times, until it stalls, or else until the `next` one can follow. What is left out is counted
    /// as done.
    pub fn times(&mut self, most: usize, next: Option<&Pass>, watch: &(dyn Fn(u64) + Sync)) -> Result<(), Lost> {
        for _ in 0..most {
            self.repeat(watch).ok_or(Lost)?;
            if self.stalled() || next.is_some_and(|next| !self.too_steep_for(next)) {
                break;
            }
        }
        watch(((most - self.repeats.len()) * self.level.lattice.count()) as u64);
        Ok(())
    }

    /// Does the pass once more; `None` where no window holds a peak.
    fn repeat(&mut self, watch: &(dyn Fn(u64) + Sync)) -> Option<()> {
        let across = self.predictor.as_ref().map_or(0.0, |field| field.change_across(self.window_vox()));
        let asked = match self.options.deform {
            Deform::Auto => !self.repeats.is_empty() || across > Deform::CHANGE_VOX,
            Deform::Always => true,
            Deform::Never => false,
        };
        let field = self.predictor.as_ref().filter(|_| asked);
        self.deformed = field.map(|field| self.moved(field));
        let trial = match (&self.deformed, field) {
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
        let Done { vectors, counts, cost, transform } = self.level.run(&trial, &search, watch);
        let heights = vectors.iter().filter_map(Vector::reading).map(|reading| reading.height);
        let measured = heights.clone().count();
        self.repeats.push(Repeat {
            deformed: trial.deformed_by.is_some(),
            change_across_vox: across,
            change_vox: change(&self.vectors, &vectors),
            correlation: heights.sum::<f64>() / measured as f64,
            direct_s: cost.direct_s,
            transform_s: cost.transform_s,
            transform,
            counts,
        });
        self.predictor = Some(self.level.predictor(&vectors)?);
        self.vectors = vectors;
        Some(())
    }

    /// Whether another repeat would change nothing that matters: little changed, or no less than the time before.
    fn stalled(&self) -> bool {
        let [.., before, last] = self.repeats.as_slice() else { return false };
        last.change_vox < self.options.stall_vox || last.change_vox > 0.8 * before.change_vox
    }

    /// Whether the displacement changes by more across a window of the `next` pass than that pass looks for.
    fn too_steep_for(&self, next: &Pass) -> bool {
        let farthest = next.search.into_iter().max().unwrap_or(0) as f64;
        self.predictor.as_ref().is_some_and(|field| field.change_across(next.window) > farthest)
    }

    fn window_vox(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.level.pass.window[a] * self.level.bin[a])
    }

    fn moved(&self, field: &Predictor) -> Vec<[Rows; 2]> {
        let one = |pair: &[Rows; 2]| {
            let least = pair.each_ref().map(|rows| rows.peak() * self.options.floor);
            matched(pair.each_ref(), field, self.mask, least).map(|rows| self.level.binned(rows))
        };
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
