//! Vectors measured, tested, searched again, replaced.

use super::{Level, Vector};
use crate::fill::fill;
use crate::options::{MedianTest, Route};
use crate::pass::{Path, measure};
use crate::peak::{Peak, Reading};
use crate::predictor::Predictor;
use crate::shifts::Shifts;
use crate::sparse::Rows;
use crate::transform::Plan;
use crate::validation;

/// What is correlated: volumes as they are, or deformed along a field that the measured shifts come on top of.
pub(crate) struct Trial<'a> {
    pub pairs: Vec<[&'a Rows; 2]>,
    pub deformed_by: Option<&'a Predictor>,
}

/// Where to look, and how.
pub(crate) struct Search<'a> {
    /// What the shifts are searched about; zero where there is none.
    pub predictor: Option<&'a Predictor>,
    /// The vectors of the time before, where this is a close look about them.
    pub known: Option<&'a [Vector]>,
    pub route: Route,
    pub test: &'a MedianTest,
}

/// What a run gives.
pub(crate) struct Done {
    pub vectors: Vec<Vector>,
    pub counts: Counts,
    /// What was estimated for products and for transforms, seconds on one core.
    pub cost_s: [f64; 2],
    /// Whether transforms were used.
    pub transform: bool,
}

/// Where the vectors of a pass came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Windows without light.
    pub dark: usize,
    /// Windows whose correlation had no peak inside the search.
    pub outside: usize,
    /// Peaks that failed the median test.
    pub outliers: usize,
    /// Of the last two, those whose second peak, near their neighbours' displacement, was taken instead.
    pub recovered: usize,
    /// Vectors replaced from their neighbours.
    pub replaced: usize,
    /// Vectors without data: dark, or nothing to replace them from.
    pub no_data: usize,
}

impl Level<'_> {
    /// Measures, validates, takes the second peak where the first fails, and replaces what is left.
    pub fn run(&self, trial: &Trial, search: &Search, watch: &(dyn Fn(u64) + Sync)) -> Done {
        let shape = self.lattice.shape();
        let count = self.lattice.count();
        let base: Vec<[f64; 3]> = (0..count)
            .map(|node| trial.deformed_by.map_or([0.0; 3], |field| field.at(self.centre_vox(node))))
            .collect();
        let shifts = |node: usize, shift_vox: [f64; 3], radius: [usize; 3]| {
            let centre = |a: usize| ((shift_vox[a] - base[node][a]) / self.bin[a] as f64).round() as i32;
            Shifts::around(std::array::from_fn(centre), radius)
        };
        let usual = if search.known.is_some() { Self::CLOSE } else { self.pass.search };
        let cost_s = self.cost(trial, usual);
        let transform = match search.route {
            // Products look close where a vector is known.
            Route::Auto => search.known.is_none() && (cost_s[1] < cost_s[0] || !self.fits(usual)),
            Route::Direct => false,
            Route::Transform => true,
        };
        // Transforms look equally far everywhere.
        let known = |node: usize| search.known.filter(|_| !transform).and_then(|vectors| vectors[node].reading());
        let box_of = |node: usize| {
            let predicted = || search.predictor.map_or([0.0; 3], |predictor| predictor.at(self.centre_vox(node)));
            Some(match known(node) {
                Some(before) => shifts(node, before.shift_vox, Self::CLOSE),
                None => shifts(node, predicted(), self.pass.search),
            })
        };
        let boxes = (0..count).map(box_of).collect();
        let path = if transform {
            Path::Transform(Plan::new(self.pass.window, self.pass.search.map(|radius| 2 * radius + 1)))
        } else {
            Path::Direct
        };
        let mut peaks = self.measure(trial, boxes, &path, &base, watch);
        if transform {
            // Transforms find the peak; its place is read off the direct sums, whose windows move with every shift.
            let found = |node: usize| inside(&peaks[node]).map(|reading| shifts(node, reading.shift_vox, Self::CLOSE));
            let boxes = (0..count).map(found).collect();
            for (peak, again) in peaks.iter_mut().zip(self.measure(trial, boxes, &Path::Direct, &base, &|_| ())) {
                if let (Some(Peak::Inside(reading)), Some(again)) = (peak, inside(&again)) {
                    *reading = Reading { ratio: reading.ratio, ..again };
                }
            }
        }
        for (node, peak) in peaks.iter_mut().enumerate() {
            // A close look sees no second peak: the one seen before stands.
            if let (Some(Peak::Inside(reading)), Some(before)) = (peak, known(node)) {
                reading.ratio = before.ratio;
            }
        }

        // Test the peaks against their neighbours, in voxels.
        let mut readings: Vec<Option<Reading>> = peaks.iter().map(inside).collect();
        let mut vectors: Vec<_> = readings.iter().map(|reading| reading.map(|r| r.shift_vox)).collect();
        let test = self.scaled(search.test, &readings);
        let outliers = validation::outliers(shape, &vectors, &test);
        let fails = |node: &usize| outliers[*node] || matches!(peaks[*node], Some(Peak::Outside));
        let failures: Vec<usize> = (0..count).filter(fails).collect();
        for &node in &failures {
            (vectors[node], readings[node]) = (None, None);
        }

        // Search the failures again, close to what their neighbours say; a second peak that fits is a measurement.
        let measured = vectors.clone();
        fill(shape, &mut vectors, failures.clone());
        let mut boxes = vec![None; count];
        for &node in &failures {
            boxes[node] = vectors[node].map(|shift| shifts(node, shift, Self::CLOSE));
        }
        let mut recovered = 0;
        if boxes.iter().any(Option::is_some) {
            for (node, peak) in self.measure(trial, boxes, &Path::Direct, &base, &|_| ()).iter().enumerate() {
                let Some(reading) = inside(peak) else { continue };
                if validation::passes(shape, &measured, node, reading.shift_vox, &test) {
                    (readings[node], vectors[node]) = (Some(reading), Some(reading.shift_vox));
                    recovered += 1;
                }
            }
        }

        // Replace the rest from everything measured by now.
        let holes: Vec<usize> = failures.into_iter().filter(|&node| readings[node].is_none()).collect();
        holes.iter().for_each(|&hole| vectors[hole] = None);
        fill(shape, &mut vectors, holes);
        let vectors: Vec<Vector> = (0..count)
            .map(|node| match (readings[node], vectors[node]) {
                (Some(reading), _) => Vector::Measured(reading),
                (None, Some(shift_vox)) => Vector::Replaced(shift_vox),
                (None, None) => Vector::NoData,
            })
            .collect();
        let counts = Counts {
            dark: peaks.iter().filter(|peak| matches!(peak, Some(Peak::Dark))).count(),
            outside: peaks.iter().filter(|peak| matches!(peak, Some(Peak::Outside))).count(),
            outliers: outliers.iter().filter(|outlier| **outlier).count(),
            recovered,
            replaced: vectors.iter().filter(|vector| matches!(vector, Vector::Replaced(_))).count(),
            no_data: vectors.iter().filter(|vector| matches!(vector, Vector::NoData)).count(),
        };
        Done { vectors, counts, cost_s, transform }
    }

    /// Constant: radius of a search about a displacement that is known to a voxel, bins: one for what it is wrong by, one for
    /// the fit.
    pub(super) const CLOSE: [usize; 3] = [2, 2, 2];

    /// The test with the tolerance that the width of the peaks asks for along each axis.
    fn scaled(&self, test: &MedianTest, readings: &[Option<Reading>]) -> MedianTest {
        let tolerance = |axis: usize| {
            let width = |reading: &Reading| reading.covariance_vox2[axis][axis].sqrt();
            let mut widths: Vec<f64> = readings.iter().flatten().map(width).filter(|width| width.is_finite()).collect();
            if widths.is_empty() {
                return test.tolerance_vox[axis];
            }
            let half = widths.len() / 2;
            let usual = *widths.select_nth_unstable_by(half, f64::total_cmp).1;
            test.tolerance_vox[axis] * (usual / MedianTest::WIDTH_VOX).max(1.0)
        };
        MedianTest { tolerance_vox: std::array::from_fn(tolerance), ..*test }
    }

    /// The peaks of the windows to be searched, displacements in voxels on top of `base`.
    fn measure(
        &self,
        trial: &Trial,
        search: Vec<Option<Shifts>>,
        path: &Path,
        base: &[[f64; 3]],
        watch: &(dyn Fn(u64) + Sync),
    ) -> Vec<Option<Peak>> {
        let mut peaks = measure(&trial.pairs, &self.lattice, &search, path, self.full, watch);
        for (peak, base) in peaks.iter_mut().zip(base) {
            if let Some(Peak::Inside(reading)) = peak {
                let bin = self.bin.map(|bin| bin as f64);
                for a in 0..3 {
                    reading.shift_vox[a] = base[a] + reading.shift_vox[a] * bin[a];
                    (0..3).for_each(|b| reading.covariance_vox2[a][b] *= bin[a] * bin[b]);
                }
            }
        }
        peaks
    }
}

fn inside(peak: &Option<Peak>) -> Option<Reading> {
    match peak {
        Some(Peak::Inside(reading)) => Some(*reading),
        _ => None,
    }
}
