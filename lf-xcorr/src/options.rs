//! What is meant by a run: its passes, when they are deformed and repeated, how products are summed, the validation.

use crate::error::{Error, Side};
use crate::lattice::Lattice;
use crate::level::binned;
use crate::shifts::channel;

/// One pass of the multigrid: interrogation windows of one size on one lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pass {
    /// Interrogation window, voxels.
    pub window: [usize; 3],
    /// Share of a window that the next one covers too, 0 to below 1.
    pub overlap: f64,
    /// Search radius about the predicted shift (zero in the first pass), voxels.
    pub search: [usize; 3],
}

impl Pass {
    /// Distance between neighbouring windows along `axis`, voxels; at least 1.
    pub fn step(&self, axis: usize) -> usize {
        ((self.window[axis] as f64 * (1.0 - self.overlap)).round() as usize).max(1)
    }

    /// Bytes that the direct path holds for the sums of `pairs` pairs: of the cells of one layer of windows, and of their
    /// columns and rows.
    pub(crate) fn direct_bytes(&self, lattice: &Lattice, pairs: usize) -> f64 {
        let shifts: f64 = self.search.iter().map(|&radius| (2 * radius + 1) as f64).product();
        let [x, y, z] = &lattice.axes;
        let layers = z.spans.iter().map(|span| span.len()).max().unwrap_or(0) + 2;
        (x.cells.len() * y.cells.len() * layers * pairs) as f64 * shifts * (channel::COUNT * size_of::<f64>()) as f64
    }

    /// Constant: the paper's windows take a fiftieth of it, and a machine that holds its volumes has it.
    pub(crate) const MOST_BYTES: f64 = 4e9;

    /// Voxels binned into one along `axis`: none for a search up to [`Pass::FINE_SEARCH`], two beyond, and more where the search
    /// would otherwise be wider than [`Pass::BINNED_SEARCH`] bins.
    pub fn bin(&self, axis: usize) -> usize {
        let search = self.search[axis];
        if search <= Self::FINE_SEARCH { 1 } else { search.div_ceil(Self::BINNED_SEARCH).max(2) }
    }

    /// Constant: widest search, in bins, of a pass that bins: every pass but the last. The cost of a pass grows with the number of
    /// trial shifts, (2 x 8 + 1)^3 at most; the next pass takes back what the bins blur. Larger: slower, more memory.
    pub const BINNED_SEARCH: usize = 8;

    /// Constant: widest search without bins. Bins of two cost an eighth, and the next pass finds what they miss.
    pub const FINE_SEARCH: usize = 5;
}

/// The normalised median test (Westerweel & Scarano, Exp. Fluids 39, 2005) over the 26 neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MedianTest {
    /// Largest accepted residual over the neighbours' median residual. The authors' value is 2.
    pub threshold: f64,
    /// Fluctuation of a good measurement along each axis, voxels: what keeps a calm neighbourhood from being too strict.
    /// The authors' 0.1 px, for a correlation peak of [`MedianTest::WIDTH_VOX`]; a wider peak raises it in proportion, axis
    /// by axis, as it raises the error of a good measurement.
    pub tolerance_vox: [f64; 3],
}

impl MedianTest {
    /// Standard deviation of the correlation peak of ideal particle images, of 0.75 voxel: 0.75 sqrt(2).
    pub const WIDTH_VOX: f64 = 0.75 * std::f64::consts::SQRT_2;
}

impl Default for MedianTest {
    fn default() -> Self {
        Self { threshold: 2.0, tolerance_vox: [0.1; 3] }
    }
}

/// When the volumes are deformed by what is known of the field before they are correlated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deform {
    /// In repeats of a pass, and the first time where the displacement changes by more across a window than the pass looks
    /// for: a plain search would not find it, and elsewhere it is not misled by what the pass before got wrong.
    Auto,
    /// Wherever something is known.
    Always,
    /// Never: windows are moved by whole voxels, and no pass is repeated. For the uncertainties the volumes are still laid on
    /// each other.
    Never,
}

/// How products are summed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Route {
    /// By what is estimated to be faster, pass by pass.
    Auto,
    /// Lit voxel by lit voxel, sums shared between overlapping windows.
    Direct,
    /// By Fourier transforms of each window.
    Transform,
}

/// What is meant by a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// From coarse to fine; each pass predicts the shift for the next.
    pub passes: Vec<Pass>,
    /// Voxels below this share of their volume's brightest are taken as dark.
    pub floor: f32,
    /// The outlier test after every pass.
    pub median_test: MedianTest,
    /// When the volumes are deformed.
    pub deform: Deform,
    /// How often the last pass is done at most, at least 1.
    pub repeats: usize,
    /// The last pass is repeated until the vectors change by less than this, root mean square, voxels.
    pub stall_vox: f64,
    /// Standard deviation of the smoothing of the field that the next time, or pass, starts from, in windows.
    pub smoothing: f64,
    /// How products are summed.
    pub route: Route,
}

impl Options {
    /// Constant: a voxel under a thousandth of the peak holds a millionth of its energy, and leaving such voxels out saves
    /// most of the work in a reconstruction with haze. On reconstructed pairs every floor from 0 to 0.01 gave the same error
    /// to 0.001 voxel; 0.03 begins to cost. See [`Options::floor`].
    pub const FLOOR: f32 = 1e-3;
    /// Constant: search of every pass after the first: the first pass is good to about a voxel (or a bin), the fit needs a
    /// voxel beyond the peak, and the rest is room for the gradients a coarse window averages.
    pub const REFINE: [usize; 3] = [4, 4, 3];

    const MOST_REPEATS: usize = 100;

    /// Constant: most repetitions of the last pass. Gradients that can be followed are followed in three or four.
    pub const REPEATS: usize = 6;
    /// Constant: repeats sharpen the field by what the smoothed field holds of it, noise and all. At 0.35 a wave of four
    /// windows is measured to 0.985 (0.90 without repeats) and noise grows by an eighth; at 0.5, 0.97 and by a fifteenth; at
    /// 0.25, 0.99 and by a quarter.
    pub const SMOOTHING: f64 = 0.35;
    /// Constant: a change that no correlation of particle images resolves.
    pub const STALL_VOX: f64 = 0.01;

    /// Two passes: `initial` with `search`, then `window` with `refine`, both at `overlap`.
    pub fn coarse_to_fine(
        initial: [usize; 3],
        window: [usize; 3],
        overlap: f64,
        search: [usize; 3],
        refine: [usize; 3],
    ) -> Self {
        let passes = vec![Pass { window: initial, overlap, search }, Pass { window, overlap, search: refine }];
        Self::of(passes)
    }

    /// Those passes, and the defaults for the rest.
    pub fn of(passes: Vec<Pass>) -> Self {
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

    /// Checks the options against the volume's `shape`.
    ///
    /// # Errors
    /// Says which number does not fit.
    pub fn check(&self, shape: [usize; 3]) -> Result<(), Error> {
        let refuse = |found: String, wanted: &str| Err(Error::new(Side::Options, found, wanted));
        if self.passes.is_empty() {
            return refuse("no pass".into(), "wanted at least one window size");
        }
        if !(self.floor >= 0.0 && self.floor < 1.0) {
            return refuse(format!("floor {}", self.floor), "wanted a share of the peak, 0 to below 1");
        }
        if !(self.median_test.threshold > 0.0 && self.median_test.tolerance_vox.iter().all(|t| *t > 0.0)) {
            return refuse("a median test that nothing passes".into(), "wanted a threshold and tolerances above 0");
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
        for (number, pass) in self.passes.iter().enumerate() {
            if !(0.0..1.0).contains(&pass.overlap) {
                return refuse(format!("overlap {}", pass.overlap), "wanted 0 to below 1");
            }
            if pass.window.contains(&0) {
                return refuse(format!("window {}", triple(pass.window)), "wanted at least one voxel along each axis");
            }
            if (0..3).any(|axis| pass.window[axis] > shape[axis]) {
                let found = format!("window {} in a volume of {} voxels", triple(pass.window), triple(shape));
                return refuse(found, "wanted a window no larger than the volume");
            }
            if pass.search.contains(&0) {
                return refuse(format!("search {}", triple(pass.search)), "wanted at least 1 voxel along each axis");
            }
            if (0..3).any(|axis| pass.search[axis] > shape[axis]) {
                let found = format!("search {} in a volume of {} voxels", triple(pass.search), triple(shape));
                return refuse(found, "wanted a search radius no larger than the volume");
            }
            let (shape, fine, _) = binned(shape, pass, number + 1 < self.passes.len());
            let bytes = fine.direct_bytes(&Lattice::new(shape, &fine), 1);
            if self.route == Route::Direct && bytes > Pass::MOST_BYTES {
                let (search, window) = (triple(pass.search), triple(pass.window));
                let found = format!("search {search} in windows {window} takes {:.0} GB directly", bytes / 1e9);
                return refuse(found, "wanted a shorter search, less overlap, a pass before it, or transforms");
            }
        }
        Ok(())
    }
}

/// `160 x 160 x 16`.
pub fn triple(n: [usize; 3]) -> String {
    format!("{} x {} x {}", n[0], n[1], n[2])
}
