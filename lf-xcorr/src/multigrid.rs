//! From two sparse volumes to a vector field: pass after pass, each predicting the shift for the next.

use crate::error::{Error, Side};
use crate::fill::{Predictor, fill};
use crate::lattice::Lattice;
use crate::options::{MedianTest, Options, Pass, triple};
use crate::pass::measure;
use crate::peak::{Peak, Reading};
use crate::shifts::Shifts;
use crate::sparse::{Rows, Sparse};
use crate::validation;
use lf_core::field::{self, Field, Layout};
use std::borrow::Cow;

/// What a pass did; the six counts of vectors after `nodes` say where its vectors came from.
#[derive(Debug, Clone, PartialEq)]
pub struct PassReport {
    /// Interrogation window, voxels.
    pub window: [usize; 3],
    /// Distance between windows, voxels.
    pub step: [usize; 3],
    /// Search radius, voxels.
    pub search: [usize; 3],
    /// Voxels binned into one; 1, 1, 1 at full resolution.
    pub bin: [usize; 3],
    /// Lit voxels (or bins) of the two volumes.
    pub lit: [usize; 2],
    /// Windows along x, y, z.
    pub nodes: [usize; 3],
    /// Windows without light.
    pub dark: usize,
    /// Windows whose correlation had no peak inside the search.
    pub outside: usize,
    /// Peaks that failed the median test.
    pub outliers: usize,
    /// Of the last two, those measured after all when searched again about their neighbours' displacement.
    pub recovered: usize,
    /// Vectors replaced from their neighbours.
    pub replaced: usize,
    /// Vectors without data: dark, or nothing to replace them from.
    pub no_data: usize,
}

/// The field, and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Displacement of the second volume against the first, mm, at the windows' centres. The history is left empty.
    ///
    /// Convention: `su`, `sv`, `sw` are NaN (not estimated). A replaced vector has `peak` and `ratio` 0, for nothing was
    /// measured; a vector without data has u, v, w NaN as well, so that it cannot pass for a displacement of zero.
    pub field: Field,
    /// One report per pass.
    pub passes: Vec<PassReport>,
}

/// Correlates two volumes of one grid.
///
/// # Errors
/// Says which volume or option does not fit, or that no window holds a peak.
///
/// # Panics
/// If a volume's lengths differ or its indices do not rise.
pub fn correlate(first: &Sparse, second: &Sparse, options: &Options) -> Result<Outcome, Error> {
    correlate_watched(first, second, options, &|_| ())
}

/// [`correlate`], calling `watch(n)` after n more windows; there are [`windows`] of them, and a few searched again.
///
/// # Errors
/// As [`correlate`].
pub fn correlate_watched(
    first: &Sparse,
    second: &Sparse,
    options: &Options,
    watch: &(dyn Fn(u64) + Sync),
) -> Result<Outcome, Error> {
    if first.grid != second.grid {
        let [a, b] = [first.grid, second.grid].map(|grid| {
            format!("{} voxels of {:?} mm at {:?} mm", triple(grid.shape), grid.spacing_mm, grid.origin_mm)
        });
        return Err(Error::new(Side::Both, format!("grids differ, {a} and {b}"), "wanted two volumes of one grid"));
    }
    let grid = first.grid;
    options.check(grid.shape)?;
    first.check(Side::First)?;
    second.check(Side::Second)?;

    let volumes = [Rows::new(first, options.floor), Rows::new(second, options.floor)];
    let mut predictor = None;
    let mut reports = Vec::new();
    for (number, pass) in options.passes.iter().enumerate() {
        let last = number + 1 == options.passes.len();
        let level = Level::new(&volumes, pass, !last);
        let (vectors, report) = level.run(predictor.as_ref(), &options.median_test, watch);
        reports.push(report);
        predictor = level.predictor(&vectors);
        if predictor.is_none() {
            let found = format!("no peak within {} voxels in any window of pass {}", triple(pass.search), number + 1);
            return Err(Error::new(Side::Both, found, "wanted the same particles in both, or a wider search"));
        }
        if last {
            let field = level.field(&vectors, grid, pass.overlap);
            return Ok(Outcome { field, passes: reports });
        }
    }
    unreachable!("the options hold at least one pass")
}

/// Windows in all passes over a volume of `shape`: what [`correlate_watched`] counts up to.
pub fn windows(shape: [usize; 3], options: &Options) -> u64 {
    let last = options.passes.len().saturating_sub(1);
    let count = |(number, pass): (usize, &Pass)| {
        let (shape, pass, _) = binned(shape, pass, number != last);
        Lattice::new(shape, &pass).count() as u64
    };
    options.passes.iter().enumerate().map(count).sum()
}

/// A vector of a pass, in voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Vector {
    Measured(Reading),
    Replaced([f64; 3]),
    NoData,
}

impl Vector {
    fn shift_vox(&self) -> Option<[f64; 3]> {
        match self {
            Self::Measured(reading) => Some(reading.shift_vox),
            Self::Replaced(shift_vox) => Some(*shift_vox),
            Self::NoData => None,
        }
    }
}

/// The volume's shape and the pass in bins, and the bin; a pass that may not bin is given back as it is.
fn binned(shape: [usize; 3], pass: &Pass, may_bin: bool) -> ([usize; 3], Pass, [usize; 3]) {
    let bin = [0, 1, 2].map(|axis| if may_bin { pass.bin(axis).min(pass.window[axis]) } else { 1 });
    let shape = [0, 1, 2].map(|axis| shape[axis].div_ceil(bin[axis]));
    let window = [0, 1, 2].map(|axis| pass.window[axis] / bin[axis]);
    let search = [0, 1, 2].map(|axis| pass.search[axis].div_ceil(bin[axis]));
    (shape, Pass { window, search, ..*pass }, bin)
}

/// One pass at its resolution. Inside, lengths are bins; what comes out is voxels.
struct Level<'a> {
    pass: Pass,
    bin: [usize; 3],
    rows: [Cow<'a, Rows>; 2],
    lattice: Lattice,
}

impl<'a> Level<'a> {
    fn new(volumes: &'a [Rows; 2], pass: &Pass, may_bin: bool) -> Self {
        let (shape, pass, bin) = binned(volumes[0].shape, pass, may_bin);
        let rows = volumes.each_ref().map(|rows| match bin {
            [1, 1, 1] => Cow::Borrowed(rows),
            _ => Cow::Owned(rows.binned(bin)),
        });
        Self { pass, bin, rows, lattice: Lattice::new(shape, &pass) }
    }

    /// Measures, validates, searches failures again and replaces what is left of them.
    fn run(
        &self,
        predictor: Option<&Predictor>,
        test: &MedianTest,
        watch: &(dyn Fn(u64) + Sync),
    ) -> (Vec<Vector>, PassReport) {
        let shape = self.lattice.shape();
        let count = self.lattice.count();
        let predicted = |node: usize| predictor.map_or([0.0; 3], |predictor| predictor.at(self.centre_vox(node)));
        let search = (0..count).map(|node| Some(self.shifts(predicted(node), self.pass.search))).collect();
        let peaks = self.measure(search, watch);

        // Test the peaks against their neighbours, in voxels.
        let tolerance_vox = std::array::from_fn(|a| test.tolerance_vox[a] * self.bin[a] as f64);
        let test = MedianTest { tolerance_vox, ..*test };
        let mut readings: Vec<Option<Reading>> = peaks.iter().map(inside).collect();
        let mut vectors: Vec<_> = readings.iter().map(|reading| reading.map(|r| r.shift_vox)).collect();
        let outliers = validation::outliers(shape, &vectors, &test);
        let fails = |node: &usize| outliers[*node] || matches!(peaks[*node], Some(Peak::Outside));
        let failures: Vec<usize> = (0..count).filter(fails).collect();
        for &node in &failures {
            (vectors[node], readings[node]) = (None, None);
        }

        // Search the failures again, close to what their neighbours say; a second peak that fits is a measurement.
        let measured = vectors.clone();
        fill(shape, &mut vectors, failures.clone());
        let mut search = vec![None; count];
        for &node in &failures {
            search[node] = vectors[node].map(|shift| self.shifts(shift, Self::SECOND_SEARCH));
        }
        let mut recovered = 0;
        if search.iter().any(Option::is_some) {
            for (node, peak) in self.measure(search, &|_| ()).iter().enumerate() {
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
        let report = PassReport {
            window: std::array::from_fn(|a| self.pass.window[a] * self.bin[a]),
            step: std::array::from_fn(|a| self.lattice.axes[a].step * self.bin[a]),
            search: std::array::from_fn(|a| self.pass.search[a] * self.bin[a]),
            bin: self.bin,
            lit: self.rows.each_ref().map(|rows| rows.count()),
            nodes: shape,
            dark: peaks.iter().filter(|peak| matches!(peak, Some(Peak::Dark))).count(),
            outside: peaks.iter().filter(|peak| matches!(peak, Some(Peak::Outside))).count(),
            outliers: outliers.iter().filter(|outlier| **outlier).count(),
            recovered,
            replaced: vectors.iter().filter(|vector| matches!(vector, Vector::Replaced(_))).count(),
            no_data: vectors.iter().filter(|vector| matches!(vector, Vector::NoData)).count(),
        };
        (vectors, report)
    }

    /// Constant: radius of the second search about the neighbours' displacement, bins: the whole voxel, one for what the
    /// neighbours miss it by, one for the fit.
    const SECOND_SEARCH: [usize; 3] = [2, 2, 2];

    fn shifts(&self, shift_vox: [f64; 3], radius: [usize; 3]) -> Shifts {
        Shifts::around(std::array::from_fn(|a| (shift_vox[a] / self.bin[a] as f64).round() as i32), radius)
    }

    /// The peaks of the windows to be searched, displacements in voxels.
    fn measure(&self, search: Vec<Option<Shifts>>, watch: &(dyn Fn(u64) + Sync)) -> Vec<Option<Peak>> {
        let mut peaks = measure(&self.rows[0], &self.rows[1], &self.lattice, &search, watch);
        for peak in &mut peaks {
            if let Some(Peak::Inside(reading)) = peak {
                (0..3).for_each(|a| reading.shift_vox[a] *= self.bin[a] as f64);
            }
        }
        peaks
    }

    /// Centre of a window, voxels.
    fn centre_vox(&self, node: usize) -> [f64; 3] {
        let node = self.lattice.node(node);
        std::array::from_fn(|a| self.voxel(a, self.lattice.axes[a].centre_vox(node[a])))
    }

    /// A place in bins along `axis`, in voxels.
    fn voxel(&self, axis: usize, place: f64) -> f64 {
        (place + 0.5) * self.bin[axis] as f64 - 0.5
    }

    /// What this pass predicts for the next.
    fn predictor(&self, vectors: &[Vector]) -> Option<Predictor> {
        let step_vox = std::array::from_fn(|a| (self.lattice.axes[a].step * self.bin[a]) as f64);
        let vectors = vectors.iter().map(Vector::shift_vox).collect();
        Predictor::new(self.lattice.shape(), self.centre_vox(0), step_vox, vectors)
    }

    /// The vectors as a field in millimetres.
    fn field(&self, vectors: &[Vector], grid: &lf_core::grid::Grid, overlap: f64) -> Field {
        let centre_vox = self.centre_vox(0);
        let mut field = Field::empty(Layout {
            shape: self.lattice.shape(),
            spacing_mm: std::array::from_fn(|a| self.lattice.axes[a].step as f64 * grid.spacing_mm[a]),
            origin_mm: std::array::from_fn(|a| grid.origin_mm[a] + centre_vox[a] * grid.spacing_mm[a]),
            voxel_mm: grid.spacing_mm,
            window: self.pass.window,
            overlap,
            dt_s: None,
            history: Vec::new(),
        });
        for (node, vector) in vectors.iter().enumerate() {
            let shift_vox = vector.shift_vox().unwrap_or([f64::NAN; 3]);
            let [u, v, w] = std::array::from_fn(|a| (shift_vox[a] * grid.spacing_mm[a]) as f32);
            (field.u[node], field.v[node], field.w[node]) = (u, v, w);
            (field.peak[node], field.ratio[node], field.flag[node]) = match vector {
                Vector::Measured(reading) => (reading.height as f32, reading.ratio as f32, field::MEASURED),
                Vector::Replaced(_) => (0.0, 0.0, field::REPLACED),
                Vector::NoData => (0.0, 0.0, field::NO_DATA),
            };
        }
        field
    }
}

fn inside(peak: &Option<Peak>) -> Option<Reading> {
    match peak {
        Some(Peak::Inside(reading)) => Some(*reading),
        _ => None,
    }
}
