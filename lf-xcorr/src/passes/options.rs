//! The options of a run.

use super::pass::{Pass, triple};
use crate::error::{Refused, Side};
use crate::{correlate::shared_sums, vectors::MedianTest};

/// When the volumes are deformed by the known field before they are correlated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deform {
    /// In repeats of a pass. The first time only if the displacement changes by more across a window than the pass
    /// searches: a search without deformation would not find it. Elsewhere the first time is not misled by errors of
    /// the pass before.
    Auto,
    /// Whenever a field is known.
    Always,
    /// Never: windows are moved by whole voxels, and no pass is repeated. The uncertainties still lay the volumes on
    /// each other.
    Never,
}

/// How products are summed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Route {
    /// By the way that is estimated to be faster, pass by pass.
    Auto,
    /// Lit voxel by lit voxel; overlapping windows share sums.
    Direct,
    /// By Fourier transforms of each window.
    Transform,
}

/// The options of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// From coarse to fine; each pass predicts the shift for the next.
    pub passes: Vec<Pass>,
    /// Voxels below this fraction of their volume's brightest are dark.
    pub floor: f32,
    /// The outlier test after every pass.
    pub median_test: MedianTest,
    /// When the volumes are deformed.
    pub deform: Deform,
    /// Most times that the last pass is done, at least 1.
    pub repeats: usize,
    /// The last pass is repeated until the root mean square change of the vectors is below this, voxels.
    pub stall_vox: f64,
    /// Standard deviation, in windows, of the smoothing of the field that the next repeat or pass starts from.
    pub smoothing: f64,
    /// How products are summed.
    pub route: Route,
}

impl Options {
    /// Constant: a voxel under a thousandth of the peak holds a millionth of its energy, and leaving such voxels out
    /// saves most of the work in a reconstruction with haze. On reconstructed pairs every floor from 0 to 0.01 gave the
    /// same error to 0.001 voxel; 0.03 begins to cost. See [`Options::floor`].
    pub const FLOOR: f32 = 1e-3;
    /// Constant: search of every pass after the first. The first pass is good to about a voxel (or a bin), the fit
    /// needs a voxel beyond the peak, and the rest is room for the gradients that a coarse window averages.
    pub const REFINE: [usize; 3] = [4, 4, 3];

    const MOST_REPEATS: usize = 100;

    /// Constant: most times that the last pass is done. Gradients that can be followed at all are followed in three or
    /// four.
    pub const REPEATS: usize = 6;
    /// Constant: repeats sharpen all that the smoothed field still holds, noise included. At 0.35 a wave of four
    /// windows is measured to 0.985 (0.90 without repeats) and noise grows by an eighth; at 0.5, 0.97 and by a
    /// fifteenth; at 0.25, 0.99 and by a quarter.
    pub const SMOOTHING: f64 = 0.35;
    /// Constant: a change that no correlation of particle images resolves.
    pub const STALL_VOX: f64 = 0.01;

    /// These passes, and the defaults for everything else.
    pub fn new(passes: Vec<Pass>) -> Self {
        Self {
            passes,
            floor: Self::FLOOR,
            median_test: MedianTest::default(),
            deform: Deform::Auto,
            repeats: Self::REPEATS,
            stall_vox: Self::STALL_VOX,
            smoothing: Self::SMOOTHING,
            route: Route::Auto,
        }
    }

    /// Two passes: `initial` with `search`, then `window` with `refine`, both at `overlap`.
    pub fn coarse_to_fine(
        initial: [usize; 3],
        window: [usize; 3],
        overlap: f64,
        search: [usize; 3],
        refine: [usize; 3],
    ) -> Self {
        Self::new(vec![Pass { window: initial, overlap, search }, Pass { window, overlap, search: refine }])
    }

    /// Whether pass `number`, counted from 0, is the last one.
    pub(crate) fn is_last(&self, number: usize) -> bool {
        number + 1 == self.passes.len()
    }

    /// Constant: most times that a pass before the last is done, if the next one could not follow it.
    const COARSE_REPEATS: usize = 4;

    /// Most times that pass `number`, counted from 0, is done.
    pub(crate) fn most_repeats(&self, number: usize) -> usize {
        match (self.deform, self.is_last(number)) {
            (Deform::Never, _) => 1,
            (_, true) => self.repeats,
            (_, false) => self.repeats.min(Self::COARSE_REPEATS),
        }
    }

    /// Windows in all passes over a volume of `shape`, repeats counted: the total that a run counts up to. Expects
    /// options that [`Options::check`] accepts.
    pub fn windows(&self, shape: [usize; 3]) -> u64 {
        let passes = self.passes.iter().enumerate();
        let count = passes.map(|(number, pass)| {
            self.most_repeats(number) * pass.binned(shape, self.is_last(number)).windows().count()
        });
        count.sum::<usize>() as u64
    }

    /// Checks the options against the volume's `shape`.
    ///
    /// # Errors
    /// The number that does not fit.
    pub fn check(&self, shape: [usize; 3]) -> Result<(), Refused> {
        let test = &self.median_test;
        if self.passes.is_empty() {
            return refuse("no pass", "wanted at least one window size");
        }
        if !(0.0..1.0).contains(&self.floor) {
            return refuse(format!("floor {}", self.floor), "wanted a fraction of the peak, 0 to below 1");
        }
        if !(test.threshold > 0.0 && test.tolerance_vox.iter().all(|t| *t > 0.0)) {
            return refuse("a median test that no vector passes", "wanted a threshold and tolerances above 0");
        }
        if !(1..=Self::MOST_REPEATS).contains(&self.repeats) {
            return refuse(format!("{} repeats of the last pass", self.repeats), "wanted 1 to 100");
        }
        if !(0.0..f64::INFINITY).contains(&self.stall_vox) {
            return refuse(format!("a stall of {} voxel", self.stall_vox), "wanted a number of 0 or more");
        }
        if !(0.0..=4.0).contains(&self.smoothing) {
            return refuse(format!("a smoothing of {} windows", self.smoothing), "wanted 0 to 4");
        }
        (0..self.passes.len()).try_for_each(|number| self.check_pass(number, shape))
    }

    fn check_pass(&self, number: usize, shape: [usize; 3]) -> Result<(), Refused> {
        let pass = &self.passes[number];
        let (window, search) = (triple(pass.window), triple(pass.search));
        let exceeds = |size: [usize; 3]| (0..3).any(|axis| size[axis] > shape[axis]);
        if !(0.0..1.0).contains(&pass.overlap) {
            return refuse(format!("overlap {}", pass.overlap), "wanted 0 to below 1");
        }
        if pass.window.contains(&0) {
            return refuse(format!("window {window}"), "wanted at least one voxel along each axis");
        }
        if exceeds(pass.window) {
            let found = format!("window {window} in a volume of {} voxels", triple(shape));
            return refuse(found, "wanted a window no larger than the volume");
        }
        if pass.search.contains(&0) {
            return refuse(format!("search {search}"), "wanted at least 1 voxel along each axis");
        }
        if exceeds(pass.search) {
            let found = format!("search {search} in a volume of {} voxels", triple(shape));
            return refuse(found, "wanted a search radius no larger than the volume");
        }
        let binned = pass.binned(shape, self.is_last(number));
        let bytes = shared_sums::bytes(&binned.windows(), binned.pass.search, 1);
        if self.route == Route::Direct && bytes > shared_sums::MOST_BYTES {
            let found = format!("search {search} in windows {window} takes {:.0} GB directly", bytes / 1e9);
            return refuse(found, "wanted a shorter search, less overlap, a pass before it, or transforms");
        }
        Ok(())
    }
}

fn refuse(found: impl Into<String>, wanted: &str) -> Result<(), Refused> {
    Err(Refused::new(Side::Options, found, wanted))
}
