//! One pass at its resolution: vectors measured, tested, searched again, replaced.

use crate::cost::{Cost, estimate};
use crate::fill::{fill, filled};
use crate::lattice::Lattice;
use crate::options::{MedianTest, Pass, Route};
use crate::pass::{Path, measure};
use crate::peak::{Peak, Reading};
use crate::predictor::Predictor;
use crate::response::{Noise, noise_ratio, unresolved};
use crate::shifts::Shifts;
use crate::sparse::Rows;
use crate::transform::Plan;
use crate::validation;
use std::borrow::Cow;

/// A vector of a pass, in voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Vector {
    Measured(Reading),
    Replaced([f64; 3]),
    NoData,
}

impl Vector {
    pub fn shift_vox(&self) -> Option<[f64; 3]> {
        match self {
            Self::Measured(reading) => Some(reading.shift_vox),
            Self::Replaced(shift_vox) => Some(*shift_vox),
            Self::NoData => None,
        }
    }

    pub fn reading(&self) -> Option<&Reading> {
        match self {
            Self::Measured(reading) => Some(reading),
            _ => None,
        }
    }
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
    pub cost: Cost,
    /// Whether transforms were used.
    pub transform: bool,
}

/// The volume's shape and the pass in bins, and the bin; a pass that may not bin is given back as it is.
pub(crate) fn binned(shape: [usize; 3], pass: &Pass, may_bin: bool) -> ([usize; 3], Pass, [usize; 3]) {
    let bin = [0, 1, 2].map(|axis| if may_bin { pass.bin(axis).min(pass.window[axis]) } else { 1 });
    let shape = [0, 1, 2].map(|axis| shape[axis].div_ceil(bin[axis]));
    let window = [0, 1, 2].map(|axis| pass.window[axis] / bin[axis]);
    let search = [0, 1, 2].map(|axis| pass.search[axis].div_ceil(bin[axis]));
    (shape, Pass { window, search, ..*pass }, bin)
}

/// One pass at its resolution. Inside, lengths are bins; what comes out is voxels.
pub(crate) struct Level<'a> {
    pub pass: Pass,
    pub bin: [usize; 3],
    pub lattice: Lattice,
    /// Standard deviation of the predictor's smoothing, windows.
    smoothing_windows: f64,
    pairs: Vec<[Cow<'a, Rows>; 2]>,
    /// Whether most voxels of a volume are lit.
    full: bool,
}

impl<'a> Level<'a> {
    pub fn new(pairs: &'a [[Rows; 2]], pass: &Pass, smoothing_windows: f64, may_bin: bool) -> Self {
        let (shape, pass, bin) = binned(pairs[0][0].shape, pass, may_bin);
        let pairs = pairs.iter().map(|pair| {
            pair.each_ref().map(|rows| match bin {
                [1, 1, 1] => Cow::Borrowed(rows),
                _ => Cow::Owned(rows.binned(bin)),
            })
        });
        let lattice = Lattice::new(shape, &pass);
        let pairs: Vec<[Cow<Rows>; 2]> = pairs.collect();
        let full = pairs.iter().flatten().any(|rows| 2 * rows.count() > shape.iter().product());
        Self { pass, bin, pairs, full, lattice, smoothing_windows }
    }

    /// A volume at the resolution of the pass.
    pub fn binned(&self, rows: Rows) -> Rows {
        if self.bin == [1; 3] { rows } else { rows.binned(self.bin) }
    }

    /// The volumes as they are.
    pub fn plain(&self) -> Trial<'_> {
        let pairs = self.pairs.iter().map(|pair| pair.each_ref().map(|rows| rows.as_ref())).collect();
        Trial { pairs, deformed_by: None }
    }

    /// Lit voxels, or bins, of the first volumes and of the second.
    pub fn lit(&self) -> [usize; 2] {
        [0, 1].map(|side| self.pairs.iter().map(|pair| pair[side].count()).sum())
    }

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
        let cost = self.cost(trial, usual);
        let transform = match search.route {
            // Products look close where a vector is known.
            Route::Auto => search.known.is_none() && (cost.transform_s < cost.direct_s || !self.fits(usual)),
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
        Done { vectors, counts, cost, transform }
    }

    /// Constant: radius of a search about a displacement that is known to a voxel, bins: one for what it is wrong by, one for
    /// the fit.
    const CLOSE: [usize; 3] = [2, 2, 2];

    /// What the pass would cost on either path, every window searched within `radius` by products, and as far as the pass
    /// says by transforms, which are read off products.
    fn cost(&self, trial: &Trial, radius: [usize; 3]) -> Cost {
        let mut sum = Cost { direct_s: 0.0, transform_s: 0.0 };
        for [first, second] in &trial.pairs {
            let cost = |radius: [usize; 3]| estimate(first, second, &self.lattice, radius);
            sum.direct_s += cost(radius).direct_s;
            sum.transform_s += cost(self.pass.search).transform_s + cost(Self::CLOSE).direct_s;
        }
        sum
    }

    /// Whether the sums of the direct path fit into [`Pass::MOST_BYTES`].
    fn fits(&self, radius: [usize; 3]) -> bool {
        let pass = Pass { search: radius, ..self.pass };
        pass.direct_bytes(&self.lattice, self.pairs.len()) <= Pass::MOST_BYTES
    }

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

    /// Centre of a window, voxels.
    pub fn centre_vox(&self, node: usize) -> [f64; 3] {
        let node = self.lattice.node(node);
        std::array::from_fn(|a| self.voxel(a, self.lattice.axes[a].centre_vox(node[a])))
    }

    /// Distance between windows, voxels.
    pub fn step_vox(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.lattice.axes[a].step * self.bin[a])
    }

    /// A place in bins along `axis`, in voxels.
    fn voxel(&self, axis: usize, place: f64) -> f64 {
        (place + 0.5) * self.bin[axis] as f64 - 0.5
    }

    /// What this pass predicts for the next.
    pub fn predictor(&self, vectors: &[Vector]) -> Option<Predictor> {
        let vectors = vectors.iter().map(Vector::shift_vox).collect();
        let step_vox = self.step_vox().map(|step| step as f64);
        let noise_ratio = noise_ratio(&self.lattice, self.smoothing());
        Predictor::new(self.lattice.shape(), self.centre_vox(0), step_vox, vectors, self.smoothing(), noise_ratio)
    }

    /// What noise becomes after the pass was done `times` times.
    pub fn noise(&self, times: usize) -> Noise {
        Noise::new(&self.lattice, self.smoothing(), times)
    }

    /// What of each vector the windows are too large for, after the pass was done `times` times, voxels. Vectors without
    /// data count as their neighbours have it.
    pub fn unresolved(&self, vectors: &[Vector], times: usize) -> Vec<[f64; 3]> {
        let known = vectors.iter().map(Vector::shift_vox).collect();
        let filled = filled(self.lattice.shape(), known).unwrap_or_else(|| vec![[0.0; 3]; vectors.len()]);
        unresolved(&self.lattice, filled, self.smoothing(), times)
    }

    /// Standard deviation of the predictor's smoothing, nodes.
    fn smoothing(&self) -> [f64; 3] {
        let axes = &self.lattice.axes;
        std::array::from_fn(|a| self.smoothing_windows * axes[a].window as f64 / axes[a].step as f64)
    }
}

fn inside(peak: &Option<Peak>) -> Option<Reading> {
    match peak {
        Some(Peak::Inside(reading)) => Some(*reading),
        _ => None,
    }
}
